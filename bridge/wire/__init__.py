"""The bus: what is said, under which topic, and how it travels. PROTOCOL.md describes it for other languages.

stickslip.proto, stickslip_pb2   the messages, and the module that `make proto` makes of them
messages                         the same as NumPy records, to the byte
topics                           who says what where
zenoh_link                       publishers, inboxes and presence over Zenoh
realtime                         priority and processor of a process that keeps time
"""
