"""The supervisory controller: listens to a rig, estimates the onset of stick-slip, keeps v_a at or above v_d.

`config` is what a file may say, `records` the derived numbers and the memory, `onset` the estimate, `vibration` the
measured v_a and the exciter's lines, `policy` what to want, `limits` what is allowed, `core` one step of all of them,
`node` the controller as a participant of the bus, `app` the process, `loop_design` the amplitude loop's margins.

    v_d  drive velocity [m/s]          s    (dF_d/dt) / (k_d v_d), the force rate [-]
    v_a  vibration velocity amplitude  f    vibration frequency [Hz]
"""
