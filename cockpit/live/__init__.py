"""A running rig, live: a browser page (`stickslip serve`), a terminal screen (`stickslip watch`), its state and commands to it.

listener   viewer session on the bus; reconnects after an absence of the rig; drops and counts messages that overflow its queue
tables     messages of one topic as one array
buckets    the last minute of curves: stretches of 5 ms of `bridge.log.viewers` on an even time grid
trigger    samples at full rate around a slip
tally      lost messages, latency of commands
answer     state of a rig in one sentence; meanings of the words
frame_words  this state line by line, for `watch` and `status`
view       the state to display, from all the modules above
frames     frames of this state for a browser, as bytes
gate       which requests of a browser are answered
token      secret that permits arming from the page
viewers    connected browsers; slow ones are dropped
server     one local port: the page, the frames, the operator's commands
foxglove_server  the live signals for Foxglove and Lichtblick, with the extra `foxglove`
operator   operator commands to a rig
operator_link  operator commands from the page
page       HTML page with uPlot and the curves of `cockpit.review`; its style is bridge/page.css
screen     `stickslip watch`: the state on a terminal
status     `stickslip status`: the state at one instant

None of this is in the control loop: a viewer session may publish nothing, and the rig waits for no viewer.
"""
