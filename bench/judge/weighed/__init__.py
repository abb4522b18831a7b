"""Every explanation with its evidences, weighed on simulated rigs: none, one effect, or two.

seen       all evidences of one folder: refits, kept runs, relations, straight lines, waves
columns    an explanation as a row of numbers, the same numbers for every campaign, rig and effect
weights    one weight for each column, shared by all explanations
training   the command that draws rigs and finds the weights, weights.json
answer     probabilities of the explanations, and of an effect that the library lacks
"""
