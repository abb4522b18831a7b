"""The verdict on a run: one judge for `run`, `log info`, `review`, `plot` and `replay`.

judged          a run judged from its log, or from the arrays of a log that was read
run_judge       messages in, verdict out; a composition of the modules below
verdict         the figures, and whether control is ok, not ok or not judged
verdict_words   the same in words
setup           the numbers of the configurations that the judge needs
window          the rows that are not judged yet, and the windows in which they are judged
phases          the stretches of a run: before the controller, while it takes over, after
slips, strokes  slips and swing of the drive force
machine_terms   following error, quadrant error at reversals, dose of vibration
pauses          stalls of the computer, and the commands that were late
watches         latency, blocks that repeat, the controller's steps
tested          whether a run tests its controller at all
ratio_watch     v_a/v_d at both ends
described       the sensors and the axis as the log describes them
relations       second by second: force and spring, vibration of base, slide and controller
sensor_watch    whether the sensors can carry a verdict; three counts of slips
margins         the stability margins of the amplitude loop
stability_map   where a rig sticks and slips, as a picture
"""
