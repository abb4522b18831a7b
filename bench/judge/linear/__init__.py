"""Linear evidence: probabilities of the effects, of `none` and of `outside` from a few refits, the relations and the kept runs.

surface       roughness and its length, estimated from the evidence
rig           the rig without effects on the floor of this surface
explanations  refits of the effects and pairs that the columns of the linear model promise
kept          remainders in runs that no fit has seen
witnesses     evidence of the relations between channels
evidence      log evidence of a remainder, and cost of free numbers
witnessed     the ledger: a row for each explanation, a number for each witness
judge         probabilities from a ledger
answer        all of it, for an evidence folder
"""
