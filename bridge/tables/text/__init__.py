"""Tables written as text, as other programs write them.

dialect     what a map may say of the text, and what is found where it says nothing
encoding    bytes to text
head        title lines, names and units above the first row
text_table  the rows, read by Arrow
"""
