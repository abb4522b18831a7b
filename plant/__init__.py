"""The rig that is not there: a LuGre contact, a compliant drive, a piezo exciter and a sensor chain.

Symbols that appear here and nowhere else, as in the paper (A. Leus et al., longitudinal tangential vibrations):

    k_t  contact stiffness [N/m]            x    position of the slide [m]
    h_t  contact damping [N s/m]            v    velocity of the slide [m/s]
    h_v  viscous damping [N s/m]            z    deflection of the bristles [m]
    F_c  Coulomb friction force [N]         s_d  position of the drive [m]
    F_s  static friction force [N]          v_r  relative velocity in the contact, v - u' [m/s]
    v_s  Stribeck velocity [m/s]            u    displacement of the base [m], u0 its amplitude [m]
    k_d  drive stiffness [N/m]              phi  phase of the vibration [rad]
    h_d  drive damping [N s/m]              g    steady friction force at a velocity [N]

and, for what a real rig adds to that:

    e      extension of the drive's spring, s_d - q - x [m]      v_lag  v_r as a lagging Stribeck curve sees it [m/s]
    q      displacement of the frame that holds the drive [m]    age    how long the contact has been at rest [s]
    s_e    where the drive would be without ripple, `even_m` [m]

`config` is what a rig file says and `config_limits` what no rig does, `pairs` the friction pairs, `effects` what a real rig does
and the nominal one does not, `records` the derived numbers and the state. `contact` is one step of friction and slide, `core` one
block of all that with the piezo and the sensors' filters (`advance`, the nominal rig, and `advance_disturbed`), `four_rigs` the
same for four rigs at once, `four_rigs_step` one step of them, `sensors` what the channels make of a block, `step` the whole block
with its messages, `simulate` a run without a bus, `stability` the linearised slider, `node` the rig as a participant of the bus,
`app` the process.
"""
