"""Which effects a rig has, and whether anything else acts: one log evidence for each explanation, and two questions.

evidence    the log evidence of a fit: its remainder, and the cost of its freedom
ledger      the rows of all witnesses: fits, kept runs, relations, latent friction
judge       the ledger's answer, without state
"""
