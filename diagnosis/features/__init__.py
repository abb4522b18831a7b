"""A run in numbers that do not depend on when it slips.

grid                        a run on the 1 ms grid
segments                    what the rig was told, and the stretches in which that does not change
cycles, slips               slips, breakaways and re-sticks of a force record; the shape around a slip
feature                     what a feature is
spring_drive, force_drive   the features of a run of either drive
axis_motion                 the measured motion along which a force-driven model is led
spring_law                  how the force follows the extension of the spring
noise                       the noise of a run, taken from the run
"""
