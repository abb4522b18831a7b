"""25 named checks of an adapter, each with its value, its limit and a remedy; each of them can fail.

heard    the blocks of a session, and the tone in them
session  facts, stages and blocks of a session
device_session  one session with a device: rest, tones, steps, and each way to end a vibration
data     the checks of blocks and channels
exciter  the checks of the vibration
both     the 19 checks that both sides share
of_device, of_client  the 25 checks of a device, and of a client on the bus
report   the results, as lines and as JUnit
"""
