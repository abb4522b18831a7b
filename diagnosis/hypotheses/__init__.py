"""The explanations of a gap that are tried.

nuisances                    numbers that may differ without being a gap, in units of their tolerances
hypothesis                   effects in given forms, and their free parameters as coordinates
catalogue, catalogue_row     every effect: its meaning, the residual that shows it, how each form is tried, the check by hand
trials, starts, scales       the trials on an evidence; where a refit starts; the scale of each parameter
waves, axis_waves, ringing   candidate periods of a wave, candidate frequencies of a swinging structure
"""
