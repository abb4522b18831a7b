"""What an axis needs: how much vibration at which speed, whether any at all, and when none helps.

need      what is remembered for each direction and speed; the ratio that the swing of friction asks for
probe     whether the vibration is needed
wobble    whether friction falls with speed, asked by a small wobble of v_a
failures  slips that no more vibration could have prevented
"""
