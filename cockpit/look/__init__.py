"""`stickslip look`: a measured file at a glance.

source   the file and what is known, as one record; what was assumed as a map
quantity a number with its unit, as people write it
evidence the record as an evidence folder
tare     the force of a stretch at the beginning in which nothing moves
hints    numbers of a rig that do not go with what is seen
page     one offline page
plots    its pictures, and figures of their own
cycles   the slips as a table
"""
