"""The plant, a simulated rig: a LuGre contact, a compliant drive, a piezo exciter and a sensor chain.

Symbols of this package, as in the paper (A. Leus et al., longitudinal tangential vibrations):

    k_t  contact stiffness [N/m]            x    position of the slide [m]
    h_t  contact damping [N s/m]            v    velocity of the slide [m/s]
    h_v  viscous damping [N s/m]            z    deflection of the bristles [m]
    F_c  Coulomb friction force [N]         s_d  position of the drive [m]
    F_s  static friction force [N]          v_r  relative velocity in the contact, v - u' [m/s]
    v_s  Stribeck velocity [m/s]            u    displacement of the base [m], u0 its amplitude [m]
    k_d  drive stiffness [N/m]              phi  phase of the vibration [rad]
    h_d  drive damping [N s/m]              g    steady friction force at a velocity [N]
    e    extension of the drive's spring, s_d - q - x [m]      v_lag  lagging v_r of the Stribeck curve [m/s]
    q    displacement of the frame that holds the drive [m]    age    how long the contact has been at rest [s]
    s_e  position of the drive without ripple, `even_m` [m]

config, config_limits  a rig file, checked; rejection of rigs that cannot exist
drive_config  the motion of the drive, in a rig file
drive_motion  its position over time: profiles, jerk-limited moves, cycles
pairs         the friction pairs
records       the derived numbers (`PARAMS`) and all memory (`STATE`)
contact, piezo  one step of friction and slide; the motion of the base
core          one block of contact, drive, piezo and analogue filters: `advance`, `advance_disturbed` with effects
sensors       the digital half of the channels
loop_delay    commands on their way to the exciter
step          one whole block with its messages
simulate      a run without bus and sensors
stability     the slider linearised around steady sliding
inputs        velocity of the drive, its announcements, noise and delays, block by block, drawn ahead by a thread
rig/          the plant behind its guard on the bus, and as a device for the guard of every rig
fmu           a rig as an FMU for other tools
effects/      effects of a real rig that the nominal rig lacks
four_rigs, four_rigs_step  the same for four or eight rigs side by side, in vector registers; one step of them
"""
