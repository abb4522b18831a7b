"""What a real rig does besides the nominal one: effects, off by default, and off to the last bit.

By the place where an effect acts, each with its forms, its numbers in the records and its formulas in one file:

friction, friction_memory            level of the friction; ageing and lag
drive, structure, piezo, sensors     what else an effect acts on

row        what an effect, a form and a parameter are
waves      waves and smooth noise, which several effects are made of
library    all of them together, and the check of a rig file's tables
"""
