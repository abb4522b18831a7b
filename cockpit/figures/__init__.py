"""A log as curves and as a figure.

signals      drawable signals: names, symbols, units, topics of the log
grid         least, mean and largest value per bin of an even time axis
request      checked content and style of a figure
curves       the numbers in a figure, also as a table
run_figure   the figure: .png, .svg or .pdf
"""
