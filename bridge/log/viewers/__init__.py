"""What the recorder adds to a log so that other programs' viewers show it: nothing of it is on the bus or read back.

stretches      smallest, mean and largest of each signal over 5 ms
scope          topic /scope: smallest, mean and largest of each signal, 200 times a second, and what was in force
foxglove_log   topic /log: events as the well-known message foxglove.Log
"""
