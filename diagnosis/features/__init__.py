"""A run as numbers that do not depend on the instants of its slips.

grid                        a run on the 1 ms grid
segments                    commands of a run, and the segments in which the commands are constant
slips                       the slips of a segment, with weights, and when a fall is half done
feature                     definition of a feature
spring_drive, force_drive   the features of a run with a spring drive, and with a force drive
axis_motion                 the measured motion along which a force-driven model is led
moving_mean                 a moving mean, compiled
spring_law                  how the force follows the extension of the spring
noise                       the noise of a run, taken from the run
"""
