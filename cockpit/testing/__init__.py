"""`stickslip test`: scenarios with expectations, run in simulated time or judged on an old log.

one      one scenario, or one of its mutants: the run, its results and its log
suite    the scenarios of files and folders, in processes
junit    the results as JUnit XML
"""
