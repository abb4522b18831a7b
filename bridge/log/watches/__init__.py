"""Statistics of a log, message by message, in a memory that does not grow with it.

event_watch   the first events of each source and code, and how many there were
histogram     percentiles to 0.25 %
arrays        differences, medians, noise and runs, without the parts of numpy that are slow to import
"""
