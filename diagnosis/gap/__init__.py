"""Measured against predicted.

prepare   measured runs made ready, once
problem   their predicted features at any point in nuisances and parameters
floor     the noise floor: what a perfect model would still show
measure   the gap in floors, by cell
"""
