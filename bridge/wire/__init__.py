"""The bus: messages, topics and transport. PROTOCOL.md describes it for clients in other languages.

stickslip.proto, stickslip_pb2   the messages, and the module that `make proto` generates from them
payloads, messages               the messages from and to bytes; as NumPy records, equal to the byte
event_codes, words               events of the bus explained; modes, states, reasons and limits explained
topics                           sender, rate and message of every topic
zenoh_link, inbox                publishers, presence and bounded inboxes over Zenoh
bus_config, session              where the processes meet; the settings of their sessions
access, loopback_users, certificates   what each role may do, and how it proves who it is
complaints, block_numbers        what is wrong with messages, told sparsely; which numbers to believe
realtime, clock                  priority and core of a real-time process; its clock, which may be simulated
pauses, core_timer               stalls of the computer, by a timer on each core
"""
