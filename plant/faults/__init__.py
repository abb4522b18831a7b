"""What goes wrong on purpose: faults of sensors, exciter, clock and bus, each a small object, the same numbers for the same seed.

    kinds     every kind of fault: what it may be done to, what its value means
    table     one table `[[fault]]` of a scenario, checked
    sensors   off, stuck, garbage, scaled, delayed, clipped, nan, swapped, drifting, jumping, ...
    exciter   weak, resonant, clipping, hot, dead, slow
    clock     the time and the numbers of the blocks
    line      the bus in one direction: dropped, repeated, reordered, late, held, cut, corrupted, forged
    orders    a person's order to a running rig
    schedule  which of them act in a block; their begin and end in words

`PlantNode` and the plant process hold one `schedule.Faults`, in real time and in simulated time alike.
"""
