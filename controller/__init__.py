"""The supervisory controller: reads a rig's sensors, detects stick, slip and smooth sliding, keeps v_a at or above v_d.

config         the controller file, checked
records        the derived numbers (`PARAMS`) and all memory (`STATE`)
announced      the announced v_d
estimate/      the motion of drive and slide, and the compliance of the drive, with their errors
vibration      the measured v_a
exciter        its gain, known and learnt, and the wanted amplitude
policy/        when to vibrate, at which frequency, and the wanted v_a; the reported reason
trips/         faults of sensors and exciter, and the response to them
limits         the allowed vibration
in_force       time in which the rig vibrates as commanded; without it no ratio changes
core           one step of the controller
telemetry      the state for plots and the memory for replay
node, app      the controller as a participant of the bus; the process
freshness      whether blocks come in time, and their age; stalls of the controller itself
replay         the controller on the frames of a log, compared with the log
fmu            the controller as an FMU for other tools
rig_header     whether the controller can control the rig

`docs/explain/the-controller.md` has its rules on a page.

    v_d  drive velocity [m/s]          s    1 - v_s / v_d, the force rate (dF_d/dt) / (k_d v_d) [-]
    v_s  velocity of the slide [m/s]   k_d  stiffness of the drive [N/m]
    v_a  vibration velocity amplitude  f    vibration frequency [Hz]
"""
