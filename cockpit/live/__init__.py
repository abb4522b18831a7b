"""A rig looked at while it runs: a page in a browser (`stickslip serve`) and a screen of a terminal (`stickslip watch`).

listener   a viewer on the bus, which dials again whenever the rig was away; what it cannot take in time is dropped and counted
tables     messages of one topic as one array
buckets    signals as smallest, mean and largest sample of some blocks; what was in force
trigger    samples at full rate around a slip
tally      what was lost, how late commands were
answer     the state of a rig in one sentence, and what its words mean
view       all of it together: what a person is shown now
frames     the same as bytes for a browser
gate       which requests of a browser are answered
token      the word that lets a person arm a rig from the page
viewers    browsers that are connected; one that is too slow is dropped
server     one port of this computer: the page, the frames, a person's words
foxglove   the same for Foxglove and Lichtblick, by the extra `foxglove`
page       the page: uPlot and the curves of `cockpit.review` inside
screen     the same in a terminal

Nothing here is in the loop: a session of the role viewer may put nothing on the bus, and the rig waits for no viewer.
"""
