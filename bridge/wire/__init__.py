"""The bus: messages, topics and transport. PROTOCOL.md describes it for clients in other languages.

stickslip.proto, stickslip_pb2   the messages, and the module that `make proto` generates from them
channels                         the table of sensor channels
payloads, messages               messages from and to bytes; messages as NumPy records with the same bytes
words, event_codes               codes explained, from stickslip.proto: modes, states, reasons, limits; events
topics                           sender, rate and message of every topic
zenoh_link, inbox                publishers, presence and bounded inboxes over Zenoh
bus_config, session              endpoint and prefix of the bus; settings of a session, permissions of each role
loopback_users, certificates     credentials of each role
refusals                         sessions that the rig refused, counted
complaints                       reports of bad messages, at a limited rate; checks of sequence numbers
realtime, clock                  priority and core of a real-time process; its clock, which may be simulated
pauses, core_timer               stalls of the computer, by a timer on each core
"""
