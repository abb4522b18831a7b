"""Injected faults of sensors, exciter, clock and bus; the same seed gives the same numbers.

    kinds     every kind of fault: its targets, and the meaning of its value (kinds.toml)
    table     one table `[[fault]]` of a scenario or of an operator's request, checked
    sensors   off, stuck, garbage, scaled, delayed, clipped, nan, swapped, drifting, jumping, ...
    exciter   its numbers: weak, resonant, clipping, hot, dead, ...
    clock     the time and the numbers of the blocks
    line      the bus in one direction: dropped, repeated, reordered, late, held, cut, corrupted, forged
    schedule  the faults that act in a block; events at their begin and end

A rig's node and its process hold one `schedule.Faults`, in real time and in simulated time alike. Faults of sensors, clock and
bus act on any rig; a simulated rig and a model have faults of their exciter too.
"""
