"""One log, or two overlaid, as one self-contained HTML file.

data          content of the page as JSON, curves as base64 of float32; modes and limits as intervals; parameters
page          the file, assembled from page.html, the scripts and uPlot (vendor/, version 1.6.32, MIT)
"""
