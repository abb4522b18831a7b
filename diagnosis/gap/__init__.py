"""Measured features against predicted features.

prepare   measured runs, reduced and cut into segments
problem   measured features, and predicted features for any rig numbers, sensor chain and effects
measure   the noise floor: the difference that remains with a perfect model; the gap in noise floors, by cell
"""
