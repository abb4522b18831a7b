"""A running rig, live: a browser page (`stickslip serve`), a terminal screen (`stickslip watch`), its state and commands to it.

listener   viewer session on the bus; reconnects after an absence of the rig; drops and counts messages that overflow its queue
buckets    messages of a topic as an array; lost messages; the last minute of curves on an even grid
trigger    samples at full rate around a slip
frame_words  the state of the rig line by line, for `watch` and `status`
view       the state to display, also in one sentence, from all the modules above
server     one local port: the page, frames for browsers (slow ones are dropped), the operator's commands
foxglove_server  the live signals for Foxglove and Lichtblick, with the extra `foxglove`
operator   operator commands to a rig
operator_link  operator commands from the page, and the token that permits arming
page       HTML page with uPlot and the curves of `cockpit.review`; its style is bridge/page.css; which requests are answered
screen     `stickslip watch`: the state on a terminal
status     `stickslip status`: the state at one instant

None of this is in the control loop: a viewer session may publish nothing, and the rig waits for no viewer.
"""
