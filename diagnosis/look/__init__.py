"""Stick-slip of one measured record at a glance: slips, friction numbers, stiffness, each with an interval.

guess        which column is time, force, load, position
record       an even record, its noise, its parts of one direction
slips        breakaways and re-sticks, on the record's own scale of time
breakaway    the mean force at breakaway from all tops laid over each other
slip_times   how long a slip and a stick last, from all falls laid over each other
slip_shape   sliding friction and the swing's frequency from all falls laid over each other
sticks       values of each slip and of the stick before it; whether a position is of the drive or of the slide
numbers      numbers with intervals of 90 %
speeds       friction over speed, and over the dwell before a slip
steady       whether the record is alike from beginning to end
look         all of it, for one record
words        a sentence for each number
"""
