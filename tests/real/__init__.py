"""Measured data that nobody here made, as evidence: what was known beforehand, and what the diagnosis made of it."""
