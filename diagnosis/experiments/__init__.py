"""What to measure or to check next.

candidate_runs   runs that could be measured next
proposal         which of these runs separates the two leading explanations
checks_by_hand   what a person can check without a run
"""
