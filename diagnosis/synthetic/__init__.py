"""Synthetic evidence, made from the plant: a rig is described, and another rig, drawn within the tolerances, is measured.

folder          the evidence folder of a case
runs            a run of the drawn rig by its plan, the ladder of runs; noise and errors of its measuring chain
"""
