"""What a real rig does besides the nominal one: effects, off by default, and off to the last bit.

library    every effect with its forms, parameters and ranges
formulas   what runs of them inside the kernels
"""
