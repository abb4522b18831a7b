"""A run as numbers that do not depend on the instants of its slips.

grid                        a run on the 1 ms grid
segments                    commands of a run, and the segments in which the commands are constant
slips                       the slips of a segment, with weights, and the instants of mid-fall
feature                     definition of a feature
spring_drive, force_drive   the features of a run with a spring drive, and with a force drive
axis_motion                 the measured motion that a force-driven model is made to follow
noise                       the noise of a run, taken from the run
"""
