"""A run in simulated time: the unchanged loops of plant and controller, in one process, with a simulated clock.

stage  loops that take turns, one at a time, their clock, and the messages between them
run    a scenario on that stage, from its start to its end, and its log
"""
