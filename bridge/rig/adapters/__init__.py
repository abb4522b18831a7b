"""Adapters: each file implements `bridge.rig.device` for one kind of device, as its class `Adapter`.

fmu     a model of another tool, run by FMPy in a separate process (_fmu_process)
scpi    the exciter is a function generator with command lines, over TCP or VISA
stream  frames of samples over TCP, or from a program that we start; a command frame each block
"""
