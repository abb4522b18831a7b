"""Measurements against other solvers and against the clock; `python -m tests.bench` runs them all."""
