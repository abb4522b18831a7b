"""What came of a run.

verdict         slips before and after, what was lost, whether it is good
margins         the stability margins of the amplitude loop
run_plot        a run as a picture
stability_map   where a rig sticks and slips, as a picture
"""
