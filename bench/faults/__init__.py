"""Every fault of deploy/faults injected in simulated time, and judged by the truth of the rig.

judge    one entry: safe, SILENT or UNSAFE
truth    a run in simulated time with the true motion of its rig
run      many entries, in processes
page     the table of all faults, in Markdown
command  the command line
"""
