"""Is there a gap, which effect closes it, how sure is that.

selection                from the baseline through all rounds of refits to what is named
judge, probabilities     one judgement over fits; scores as probabilities
lookalikes               which effects these runs cannot tell apart
held_out, confirmation   how far the gap closes on runs that no fit has seen; which names they refute
blend                    what a blend of all effects would close, to compare with
"""
