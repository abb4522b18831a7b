"""Tests of a rig: scenarios with expectations, in simulated time or judged on an old log, and the fixture `rig` of pytest.

one        one scenario, or one of its mutants: the run, its results and its log
suite      the scenarios of files and folders, in processes
target     the rig of a test: a simulated rig, a model, or a device behind its guard
lock       the lock of a real rig, and its quarantine
realtime   a test of a real rig: arm, change, end
junit      the results as JUnit XML
picture    one expectation on its signal as SVG        page  one offline page of many tests
api        a rig, its runs and expectations in Python
session    the rigs of one test in Python; the logs and pictures of a failed one
plugin     the plug-in of pytest
"""
