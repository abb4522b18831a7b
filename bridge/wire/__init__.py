"""The bus: messages, topics and transport. PROTOCOL.md describes it for clients in other languages.

stickslip.proto, stickslip_pb2   the messages, and the module that `make proto` generates from them
payloads, messages               the messages from and to bytes; as NumPy records, equal to the byte
words                            modes, states, reasons and limits explained
topics                           sender, rate and message of every topic
zenoh_link                       publishers, inboxes and presence over Zenoh
realtime                         priority and core of a real-time process
"""
