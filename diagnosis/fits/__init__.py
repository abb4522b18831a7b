"""Refits, from one to the search over all trials.

retuning                   the baseline: the rig without effects, refitted within its tolerances; every fit is compared with it
fit, gauss_newton, batch   one fit; how a fit is found; many fits at once, whose predictions run side by side
search                     from all trials to the few trials that are refitted in full
screening, refits          a cheap estimate of the gain of each trial; refits spread over processes
restarts, late_friction    further starts: for fits that come close to the best one; for friction that lags by much
load_phases                starts for the refit of a load wave, with a phase for every run
random_friction            friction that changes without a path to follow: judged by the scatter that it causes
refloored                  a second search under the noise floor of the nearest model, where no trial explains the runs
expected                   the chi2 that a right model leaves, and whether noise hides the slips
"""
