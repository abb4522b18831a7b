"""Slips, friction numbers and stiffness of one measured record, each number with an interval.

guess        which column is time, force, load, position
record       an even record, its noise, its parts of one direction
slips        breakaways and re-sticks; the scale of time comes from the record
breakaway    the mean force at breakaway from all tops laid over each other
slip_times   durations of slip and stick from all falls laid over each other
slip_shape   sliding friction and the swing's frequency from all falls laid over each other
sticks       values of each slip and of the stick before it; whether a position belongs to the drive or to the slide
numbers      numbers with intervals of 90 %
speeds       friction over speed, and over the dwell before a slip
steady       whether breakaway or speed drifts over the record
look         all numbers of one record
words        a sentence for each number
"""
