"""The plant as a rig: behind its guard on the bus, and as a device for the guard of every rig.

node     the rig behind its guard, in one compiled step
device   the physics alone as a device
box      this device in another process, behind a TCP port
generator  its exciter as a function generator with command lines
exciter_faults  injected faults of the exciter
"""
