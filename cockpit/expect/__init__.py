"""Expectations on a run: the tables `[[expect]]` of a scenario, judged on a finished log of any rig.

tables   the tables `[[expect]]` and `[[must_fail]]`
events   words and times of the events in a log
record   a log as an expectation sees it: samples, gaps, time with a controller in charge
judge    PASSED, FAILED or UNTESTED for each expectation
"""
