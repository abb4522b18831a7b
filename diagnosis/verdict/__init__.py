"""Is there a gap, which effect closes it, and how sure is the answer.

selection                from the baseline through all rounds of refits to the named effects
judge, probabilities     one judgement over fits; scores as probabilities
lookalikes               which effects these runs cannot tell apart
held_out, confirmation   how far the gap closes on held-out runs; which named effects these runs refute
blend                    how far a blend of all effects closes the gap, for comparison
by_latent, by_relations  the verdict of the fits, corrected by latent friction and by the relations
"""
