"""The catalogue of faults: what may go wrong at a rig, what must come of it, and what truly does.

catalogue  the entries of deploy/faults, checked
judge      one entry, from the truth of its run: safe, SILENT or UNSAFE
bench      many entries, in processes
page       the table for a person
injection  a fault for a loop that runs
"""
