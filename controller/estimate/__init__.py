"""The estimate: the motion of drive and slide, from force and positions.

channels    conditioned samples; faults that one channel shows: spikes, steps, repeated blocks, grown noise
windows     slopes of the signals in windows of all lengths, and the measured noise of each
motion      v_d, its direction, its standstill
contact     stick, slip, surge or smooth sliding; the breakaway force; whether a stick can be seen at all
compliance  c = 1 / k_d with its error; v_s by force and position
"""
