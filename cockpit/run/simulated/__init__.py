"""A run in simulated time: the unchanged loops of plant and controller, in one process, with a simulated clock.

stage  threads that take turns, one at a time, and their clock
bus    messages between them, and the roles that are present
run    a scenario on that stage, from its start to its end
log    the log of such a run
"""
