"""A log as curves and as a figure.

signals      what can be drawn: names, symbols, units, where in a log it is
grid         least, mean and largest value of each bin of an even time axis
request      what a figure shall show and look like, checked
curves       the numbers that a figure shows, also as a table
run_figure   the figure: .png, .svg or .pdf
"""
