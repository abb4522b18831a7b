"""Prediction of one run under the commands of that run, as its sensors would show it.

rig                            the rig to predict: numbers, effects, start, surface
predict                        one run of one rig, or of four rigs at once, by the plant's equations
segment_starts                 force and contact age with which every segment of the model begins
sensor_chain                   a prediction as the sensors show it: faults, and ordinary lags
true_force                     the true force on a force-driven axis, from the measured one and the faults of its sensor
per_run                        parameters of an effect that differ from run to run
"""
