"""When to vibrate, and how strongly.

decide     the mode and the wanted v_a: WATCH, EXCITE, PROBE
ratio      the ratio v_a / v_d, by the swing of friction
trial      trials without vibration, and the need that they show
reason     the reported reason, derived at the end of a step
"""
