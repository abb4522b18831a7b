"""A log as curves and as a figure, and the stability of a rig as a figure.

signals        drawable signals: names, symbols, units, topics, panels of the pages
curves         checked request of a figure; its numbers, binned over time, also as a table
run_figure     the figure of a log: .png, .svg or .pdf
stability_map  where a rig sticks and slips
"""
