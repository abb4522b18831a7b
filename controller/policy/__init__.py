"""When to vibrate, and how strongly.

decide     the mode and the wanted v_a: WATCH, EXCITE, PROBE
need       at which speeds vibration is needed
ratio      the ratio v_a / v_d, by the swing of friction
trial      trials without vibration, judged by the fall of the force
reason     the reported reason, derived at the end of a step
"""
