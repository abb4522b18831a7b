"""The verdict on a run: one judge for `run`, `log info`, `review`, `plot` and `replay`.

judged          judges a run from its log, or from the arrays of a log in memory; the results of `log info` and `run`
run_judge       messages in, verdict out; sums over the windows; composed of the modules below
verdict         the figures, and whether control is ok, not ok or not judged
verdict_words   the same in words
finding_codes   meaning of the verdict's own codes, for `stickslip explain`
setup           numbers that the judge takes from the configurations in a log, with the description of sensors and axis
window          pending rows, and the windows in which they are judged
phases          stretches of a run: before the controller, hand-over, after; interruptions; whether it tests its controller
slips           strokes of the drive; slips and swing of its force
machine_terms   following error, quadrant error at reversals, dose of vibration
pauses          stalls of the computer, and late commands
watches         repeated blocks, latency, state of the rig, the controller's steps, completeness of the log
ratio_watch     v_a/v_d against a lower and an upper limit
sensor_watch    whether the sensors can carry a verdict; their relations, second by second; three counts of slips
"""
