"""What is tried as an explanation.

nuisances                    what may differ without being a gap, in units of its tolerance
hypothesis                   effects in given forms, and their free parameters as coordinates
trials, scales               every effect in every form with its starts; the scale of each parameter
waves, axis_waves, ringing   periods at which a wave, frequencies at which a swinging structure may be looked for
"""
