"""Text tables of other programs.

dialect     delimiter, decimals and more, from the map or detected
encoding    bytes to text
labels      labels between the numbers of a line
properties  lines of properties of the channels, above the rows
head        title lines, names and units above the first row
text_table  the rows, read by Arrow
unit_cells  cells with a number and its unit, as gauges write them
"""
