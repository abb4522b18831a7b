"""A log, or two laid over each other, as one HTML file that needs nothing else.

panels        which curves stand together, and what there is to see in them
bands         what the controller did, as stretches of time with a word each
differences   parameters of two logs that are not the same
data          all of it as JSON, curves as base64 of float32
page          the file: page.html with page.css, the scripts and uPlot (vendor/, version 1.6.32, MIT) inside
"""
