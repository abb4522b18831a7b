"""Measurements against other solvers and against the clock; `python -m tests.speed` runs them all."""
