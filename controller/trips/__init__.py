"""Trips: detected faults of a sensor or of the exciter, the response, and the reset.

doubts     which signals are doubted, the reported trip, its reset by the operator
band       the exciter's known gain, and the stroke that it allows for any reading of the accelerometer
delivered  measured v_a against the v_a expected from the command: OPEN_LOOP, CLIPPED, SWAPPED, RESONANCE, NOISE
frozen     channels that repeat their bits: FROZEN; an accelerometer that drops out: LOOSE
spring     force and positions against the law of the drive's spring: FORCE_DOUBTED, DRIVE_DOUBTED, SLIDE_DOUBTED
confirmed  v_d as far as slide and force confirm it: POSITIONS_APART
age        age of the blocks when they are answered
jumps      a drive position that jumps: JUMPED
reset      a reset forgets values learnt from a doubted force or position
noise      noise that grows many times, or too many slips: NOISE
watch      all checks, once a block
trip_events  trips and limits as events
"""
