"""A log as curves and as a figure, and the stability of a rig as a figure.

signals        drawable signals: names, symbols, units, topics, panels of the pages
grid           least, mean and largest value per bin of an even time axis
request        checked content and style of a figure
curves         the numbers in a figure, also as a table
run_figure     the figure of a log: .png, .svg or .pdf
stability_map  where a rig sticks and slips
"""
