"""Evidence made from the plant: a described rig, and a drawn one that is measured.

folder          the folder, for a case
runs, sensors   one run of it; what its measuring chain adds
protocols       which runs are measured, by name
"""
