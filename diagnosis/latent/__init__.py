"""Latent friction: shares of place, direction, time, speed and load in the friction, without a formula and a simulation.

answer           the latent friction of an evidence
rows             breakaway levels and sliding friction as rows; spring_rows: of a slide on a spring, axis_rows: of an axis
components       the processes of the mixed model, each with a covariance: a new share is a process here
reml             variances and lengths of the processes
shares           the part of each process in the held-out runs
"""
