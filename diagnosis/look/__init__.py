"""Slips, friction numbers and stiffness of one measured record, each number with an interval.

guess        which column is time, force, load, position
slips        a record as even parts of one direction; breakaways and re-sticks of a part
laid_over    breakaway force, durations of slip and stick, from all slips of a record laid over each other
slip_shape   sliding friction and the swing's frequency from all falls laid over each other
creep        the contact in a stick: its compliance, and the limit of the friction
sticks       values of each slip and of the stick before it; whether a position belongs to the drive or to the slide
numbers      numbers with intervals of 90 %
motion       stick-slip in a following error, a motor current or a position, without a force
speeds       friction over speed, and over the dwell before a slip; whether breakaway or speed drifts
look         all numbers of one record
words        a sentence for each number
"""
