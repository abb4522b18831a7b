"""What came of a run.

verdict         slips before and after, what was lost, whether it is good
verdict_words   the same in words
phases          the stretches of a run: before the controller, while it takes over, after
machine_terms   following error, quadrant error at reversals, dose of vibration
margins         the stability margins of the amplitude loop
stability_map   where a rig sticks and slips, as a picture
"""
