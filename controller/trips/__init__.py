"""Trips: detected faults of a sensor or of the exciter, the response, and the reset.

doubts     which signals are doubted, and the reported trip
consistency  drive, slide and force against the law of the spring: FORCE_DOUBTED, DRIVE_DOUBTED, SLIDE_DOUBTED, POSITIONS_APART
reset      the end of all trips, by the operator or a loop check
watch      all checks, once a block
trip_events  trips and limits as events
"""
