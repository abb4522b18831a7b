"""One run predicted under the run's own commands, as its sensors would show it.

rig                            the rig that is predicted: numbers, effects, start, surface
predict                        one run, or four at once, by the plant's equations
segment_starts                 force and state with which every segment of the model begins
sensor_chain                   what sensors make of a prediction: faults, and ordinary lags
true_force                     the true input of a force-driven axis, freed of what its sensor did to it
per_run                        parameters of an effect that differ from run to run
"""
