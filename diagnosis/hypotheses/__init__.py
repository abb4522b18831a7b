"""The explanations of a gap that are tried.

nuisances                    numbers that may differ without being a gap, in units of their tolerances
hypothesis                   effects in given forms, their free parameters as coordinates, and the scales of these
catalogue                    every effect: its meaning, the residual that shows it, its trials, the check by hand
starts                       where a refit starts
waves                        candidate periods of a wave, candidate frequencies of a swinging structure
"""
