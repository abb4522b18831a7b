"""The supervisory controller: listens to a rig, estimates the onset of stick-slip, keeps v_a at or above v_d.

config         the controller file, checked
records        the derived numbers (`PARAMS`) and all memory (`STATE`)
announced      what the rig has announced of v_d
vibration      the measured v_a; the slide's burst without the exciter's lines
onset          the estimate: stick, slip or smooth sliding, and the time to the next slip
policy         the wanted vibration
limits         the allowed vibration
core           one step of all of these
telemetry      the state for plots and the memory for replay
node, app      the controller as a participant of the bus; the process
replay         the controller on the frames of a log
codes          modes, states, reasons and limits as numbers
loop_design    gain and margins of the amplitude loop

    v_d  drive velocity [m/s]          s    (dF_d/dt) / (k_d v_d), the force rate [-]
    v_a  vibration velocity amplitude  f    vibration frequency [Hz]
"""
