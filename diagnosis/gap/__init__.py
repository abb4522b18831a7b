"""Measured features against predicted features.

prepare   measured runs, reduced and cut into segments
problem   measured features, and predicted features for any rig numbers, sensor chain and effects
floor     the noise floor: the difference that remains with a perfect model
measure   the gap in noise floors, by cell (signal x regime x band x run)
excerpt   shortening of long records before simulation
"""
