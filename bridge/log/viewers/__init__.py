"""Topics that the recorder adds to a log for other programs' viewers: not on the bus, and never read back.

stretches      smallest, mean and largest of each signal over 5 ms
scope          topic /scope: smallest, mean and largest of each signal, 200 times a second, with the applied command
foxglove_log   topic /log: events as the public message type foxglove.Log, which foxglove/Log.proto defines
"""
