"""The estimate: the motion of drive and slide, from force and positions.

windows     slopes of the signals in windows of all lengths, and the measured noise of each
motion      v_d, its direction, its standstill
contact     stick, slip, surge or smooth sliding; whether a stick can be seen at all
compliance  c = 1 / k_d with its error; v_s by force and position
friction    breakaway and sliding force, fall of the force in a slip
spikes      spikes
"""
