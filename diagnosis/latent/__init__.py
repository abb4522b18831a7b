"""Latent friction: shares of place, direction, time, speed and load in the friction, without a formula and a simulation.

answer           the latent friction of an evidence; the effects that it shows
rows             breakaway levels and sliding friction as rows; spring_rows: of a slide on a spring, axis_rows: of an axis
causes           the courses that each cause can take over the rows: a new share is a column or a family of waves here
pursuit          the courses that predict a run from the other runs
shares           the part of the held-out rows that each cause predicts, its null, and whether its size agrees between runs
"""
