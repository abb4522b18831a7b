"""Prediction of a run: the signals that its sensors would show under its commands.

rig                            the rig to predict: numbers, effects, start, surface
predict                        one run of one rig, or of four rigs at once, by the plant's equations
segment_starts                 force and contact age with which every segment of the model begins
sensor_chain                   sensor faults and ordinary lags, applied to a prediction; their inverse for a force-driven axis
per_run                        parameters of an effect that differ from run to run
"""
