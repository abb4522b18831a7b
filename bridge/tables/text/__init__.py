"""Text tables of other programs.

dialect     delimiter, decimals and more, from the map or detected
encoding    bytes to text
head        title lines, names and units above the first row
text_table  the rows, read by Arrow
unit_cells  cells with a number and its unit, as gauges write them
"""
