"""Names from witnesses that were weighed on simulated rigs.

campaigns   descriptions and commands to train on
rigs        rigs of these campaigns with drawn effects, and their measured runs
witnesses   log evidence for each effect: straight lines, relations, the refitted rig
inputs      the witnesses as a table with the same columns in every campaign
softmax     weights that all effects share
second      a second effect, after the first
closer      refits of effects that the witnesses leave close
training    the command that trains the model, model.json
answer      the names of an evidence
"""
