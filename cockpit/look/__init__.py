"""`stickslip look`: estimates from a measured file.

source   reads the file and the given facts into one record; writes the assumptions as a map
tare     zero of the force sensor, from a stretch of rest at the beginning
hints    rig numbers that contradict the record
result   the numbers with the findings on the file
page     one offline page
plots    pictures of the page, also as separate figures
cycles   the slips as a table
findings  findings about omitted rows
quantity a number with its unit on the command line
evidence the record as an evidence folder
"""
