"""Latent friction: what the level of the friction goes with, as shares of its variance, without a formula and a simulation.

Rows are breakaways and sliding friction (`rows`). One mixed model splits them into processes over speed, place, time, direction,
load and run, with variances and lengths by REML (`components`, `reml`); `shares` says what each explains on the held-out runs.
answer           the latent friction of an evidence
axis_rows        friction of a force-driven axis
spring_rows      friction of a slide on a spring
"""
