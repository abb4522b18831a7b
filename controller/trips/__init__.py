"""Trips: what the controller takes for a fault of a sensor or of the exciter, what it does then, and what ends it.

doubts     which signals are doubted, the trip that is told, and that a person ends it
band       the exciter's known gain, and the stroke that it allows whatever the accelerometer says
delivered  v_a as measured against what the command gives: OPEN_LOOP, CLIPPED, SWAPPED, RESONANCE, NOISE
frozen     channels that repeat their bits: FROZEN; an accelerometer that drops out: LOOSE
spring     force and positions against the law of the drive's spring: FORCE_DOUBTED, DRIVE_DOUBTED, SLIDE_DOUBTED
confirmed  v_d as far as slide and force confirm it: POSITIONS_APART
stall      after a stall of the computer or the link no doubt begins until v_a belongs to the command again
age        how old the blocks are when they are answered
jumps      a place of the drive that jumps: JUMPED
anew       what a doubted force or place has taught is forgotten on a reset
noise      noise that becomes many times larger, slips of which there are too many: NOISE
watch      all of them, once a block
tell       trips and limits as events
"""
