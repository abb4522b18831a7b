"""Refits, from one to the search over all trials.

baseline, surface          the rig without effects, refitted within its tolerances; every fit is compared with it
fit, gauss_newton, batch   one fit; how a fit is found; many fits at once, whose predictions run side by side
explanations               from all trials to the fits of one effect and of two
screening                  a cheap estimate of the gain of each trial
evidence, estimates        log evidence of a fit; its parameters with intervals
held_out                   how far a fit closes the gap on held-out runs
"""
