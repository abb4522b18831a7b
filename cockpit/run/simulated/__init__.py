"""A run in simulated time: the loops of plant and controller as they are, in one process, with a clock that waits for nobody.

stage  threads that take turns, one at a time, and the clock between them
bus    what they say to one another, and who is there
run    a scenario on that stage, from its start to its end
"""
