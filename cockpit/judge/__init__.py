"""What came of a run.

verdict         slips before and after, what was lost, whether it is good
verdict_words   the same in words
margins         the stability margins of the amplitude loop
stability_map   where a rig sticks and slips, as a picture
"""
