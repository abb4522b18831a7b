"""What to do next.

candidate_runs   runs that could be measured
proposal         which of them separates the leading explanations
checks_by_hand   what a person can check without a run
"""
