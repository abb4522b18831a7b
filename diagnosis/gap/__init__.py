"""Measured features against predicted features.

prepare   measured runs are reduced and cut into segments, once
problem   measured features, and predicted features for any rig numbers, sensor chain and effects
floor     the noise floor: the difference that a perfect model would still show
measure   the gap in noise floors, by cell (signal x regime x band x run)
excerpt   the excerpt of long records that is simulated
"""
