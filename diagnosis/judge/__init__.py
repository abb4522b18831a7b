"""Which effects a rig has, and whether anything else acts: one log evidence for each explanation, and two questions.

witnesses   relations, latent friction, fits and held-out runs of an evidence, as far as they end in time
relations   the log evidence of the relations for an explanation
ledger      the rows of all witnesses
judge       the answer to a ledger, without state
outcome     the verdict of the format from this answer; described numbers that were wrong
"""
