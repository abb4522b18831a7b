"""Refits, from one to the search over all trials.

retuning                   the baseline: the rig without effects, refitted; all evidence is measured against it
fit, gauss_newton, batch   a fit; how it is found; many at once whose predictions go side by side
search                     from all trials to the few that are refitted in full
screening, refits          what every trial promises, cheaply; refits spread over processes
restarts, late_friction    further starts: for close contenders; for friction that lags by much
load_phases                where the refit of a load wave starts, in the phases of every run
random_friction            friction without a path that could be followed: judged by what it scatters
refloored                  once more on the floors of the nearest model, where nothing explains the runs
expected                   what a right model leaves, and what noise hides
"""
