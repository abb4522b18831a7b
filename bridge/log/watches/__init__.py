"""What a log is looked at for, message by message in a memory that does not grow: losses, events, distributions of values.

event_watch   the first events of each source and code, and how many there were
histogram     percentiles to 0.25 %
arrays        differences and medians, without the parts of numpy that are slow to import
"""
