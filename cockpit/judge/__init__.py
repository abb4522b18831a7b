"""The verdict on a run: one judge for `run`, `log info`, `review`, `plot` and `replay`.

judged          judges a run from its log, or from the arrays of a log in memory
run_judge       messages in, verdict out; composed of the modules below
verdict         the figures, and whether control is ok, not ok or not judged
verdict_words   the same in words
setup           numbers of the configurations: for the judge, and the description of sensors and axis
window          pending rows, and the windows in which they are judged
judged_windows  sums over the windows: stretches, slips, checks
phases          stretches of a run: before the controller, hand-over, after; interruptions of the controller
slips, strokes  slips and swing of the drive force
machine_terms   following error, quadrant error at reversals, dose of vibration
pauses          stalls of the computer, and late commands
watches         repeated blocks, latency, state of the rig, the controller's steps
losses          completeness of the log
tested          whether a run tests its controller at all
ratio_watch     v_a/v_d at both ends
relations       second by second: force and spring, vibration of base, slide and controller
sensor_watch    whether the sensors can carry a verdict; three counts of slips
margins         the stability margins of the amplitude loop
"""
