"""What crosses a process border, and the only input and output of the project.

Messages (`stickslip.proto`, `messages`), the table of topics (`topics`), the Zenoh link (`zenoh_link`), the run log
(`runlog` writes, `logfile` reads, `recorder` is the process), real-time scheduling (`realtime`), strict configuration
(`config`), faults with their codes (`faults`) and the kernel compiler (`kernel`). `PROTOCOL.md` describes the wire well
enough to write a client from that page alone.
"""
