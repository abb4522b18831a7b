"""Effects of a real rig that the nominal rig lacks: off by default, and then without any trace in the results.

One file per place where effects act, with their forms, their numbers in the records and their formulas:

friction, friction_memory            level of the friction; ageing and lag
drive, structure, piezo, sensors     all other effects
row                                  definitions of effect, form and parameter
waves                                waves and smooth noise, which several effects are made of
library                              all of them together, and the check of a rig file's tables

"""
