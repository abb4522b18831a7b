"""What is tried as an explanation.

nuisances                    what may differ without being a gap, in units of its tolerance
hypothesis                   effects in given forms, and their free parameters as coordinates
catalogue, catalogue_row     every effect in words: what shows it, how each form is tried, what to check by hand
trials, starts, scales       what is tried on an evidence; where a refit starts; the scale of each parameter
waves, axis_waves, ringing   periods at which a wave, frequencies at which a swinging structure may be looked for
"""
