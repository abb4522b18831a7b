"""Statistics of a log, message by message, in constant memory.

event_watch   the first events of each source and code, and their counts; stalls of the computer
histogram     percentiles to 0.25 %
arrays        differences, medians, noise and runs, without the parts of numpy that are slow to import
"""
