"""How far the controller can be trusted: drawn axes, axes that never stick, disturbed runs, re-sticks and trials.

reports    events of rig and controller that report a fault or a limit, from the messages of a run
never      axes that never stick: the share of time in which they are vibrated
disturbed  a sagging exciter, missing commands and late blocks, in simulated time
trials     slips and surges in the trials of axes that need vibration
restick    delay of the announcement of a re-stick, and false announcements
result     all parts, in processes: as a result, as JSON, in words
command    the command line, `python -m bench trust`
"""
