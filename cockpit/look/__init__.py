"""`stickslip look`: estimates from a measured file.

source   reads the file and the given facts into one record, and its result; writes the assumptions as a map
units    units of the columns, and of a number that holds no force
pieces   the result, with the numbers of each piece and stroke
doubts   questions about results that no rig has
page     one offline page, and its pictures, also as separate figures
cycles   the slips as a table
findings findings about omitted rows; zero of the force sensor, from a stretch of rest at the beginning
quantity a number with its unit on the command line
evidence the record as an evidence folder; rig numbers that contradict the record
"""
