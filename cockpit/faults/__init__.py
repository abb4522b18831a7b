"""Catalogue of faults: possible failures of a rig, and the required reactions.

catalogue  each case of the scenarios in deploy/faults
injection  injects a fault into a running loop

`python -m bench faults` judges each entry by the simulated truth of its run.
"""
