"""One log, or two overlaid, as one self-contained HTML file.

bands         modes and limits of the controller as intervals with a word each
differences   parameters that differ between two logs
data          content of the page as JSON, curves as base64 of float32
page          the file, assembled from page.html, the scripts and uPlot (vendor/, version 1.6.32, MIT)
"""
