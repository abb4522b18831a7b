"""When to vibrate, and how strongly.

decide     the mode and the wanted v_a: WATCH, EXCITE, PROBE
modes      changes of the mode, and of the frequency
need       at which speeds vibration is needed, and how much
fall       falls of the raw force, as in a slip
trial      trials without vibration: whether it is needed, and whether it helps
frequency  the cheapest allowed frequency
reason     the reported reason, derived at the end of a step
"""
