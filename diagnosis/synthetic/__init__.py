"""Synthetic evidence, made from the plant: a rig is described, and another rig, drawn within the tolerances, is measured.

folder          the evidence folder of a case
runs, sensors   a run of the drawn rig; noise and errors of its measuring chain
protocols       the runs of an evidence folder, by name
"""
