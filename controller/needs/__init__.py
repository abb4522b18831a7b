"""The vibration that an axis needs: how much at which speed, whether it is needed at all, and when it does not help.

need      the learnt need for each direction and speed; the ratio that the swing of friction requires
probe     whether the vibration is needed
wobble    a test by a small wobble of v_a whether friction falls with speed
failures  slips that more vibration could not have prevented
"""
