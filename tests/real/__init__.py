"""Measured data of others as evidence: facts known in advance, and the diagnosis."""
