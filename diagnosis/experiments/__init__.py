"""The next run to measure, or the next check by hand.

candidate_runs   runs that could be measured next
proposal         the run that separates the two leading explanations, or a check by hand
"""
