"""The guard on the rig's side of the bus: the states of the rig, and limits for the exciter that no controller can exceed.

It is a process stop and no safety function: an emergency stop belongs in the supply of the amplifier.

    config   the table `[guard]` of a rig file
    records  its parameters and its memory
    states   DISARMED, CHECKING, READY, ARMED, ACTIVE, FAULT
    limits   stroke, velocity, bands, heat, duty: each with alarm, abort and hold
    estimates  drive velocity and vibration velocity, from the rig's own samples
    check    the loop check: sensors live, exciter answers, its gain
    core     `accept` a command, `look` at a block, `allow` a vibration
    kept     the operator's stop, the accepted exciter gain and the exciter's warmth, kept over restarts
    keeper   the thread that writes and watches these files
    stop_file  a stop without the bus: set, found and confirmed as a file
    absent   channels that a rig lacks: refused, or the lost protection
    wide     limits of a rig file that protect less than usual
    events   events of a rig's guard
    received valid commands of the bus, in order

`core` and its callees are pure: no clock, no file, no bus. A device adapter calls them as `plant.step` does.
"""
