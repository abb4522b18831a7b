"""The guard on the rig's side of the bus: what the exciter may do, whatever a controller commands, and the states of the rig.

It is a process stop and no safety function: an emergency stop belongs into the supply of the amplifier.

    config   the table `[guard]` of a rig file
    records  its parameters and its memory
    states   DISARMED, CHECKING, READY, ARMED, ACTIVE, FAULT
    limits   stroke, velocity, bands, heat, duty: each with alarm, abort and hold
    senses   drive velocity and vibration velocity, from the rig's own samples
    check    the loop check: sensors alive, exciter answers, its gain
    core     `accept` a command, `look` at a block, `allow` a vibration
    received the commands as they come from the bus, those that mean something
    latch    a person's stop, kept over restarts

`core` and what it calls are pure: no clock, no file, no bus. A device adapter calls them as `plant.step` does.
"""
