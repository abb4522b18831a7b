"""Run logs: every message of a run in one MCAP file.

library                  the header of every log
mcap_chunks, runlog      writing in small chunks, so that a kill costs at most one chunk
viewers/                 topics for the viewers of other programs
storage/                 the files of a log: their order, the reaction to a failing disk, checksums, the verdict file
block_rows               the messages of many blocks as the bytes of a chunk
screen                   filter of the messages that go into a log
recorder                 the process that writes every message on the bus
log_reader, logfile      reading a log, whole or cut, without seeking; its topics as arrays
chunk_messages           places of the messages in the bytes of chunks
chunk_bytes              one chunk of any compression, unpacked and checked; search for the next whole chunk after damage
definitions              schemas and channels of a file: the topic of each channel, and whether it belongs to this project
damage, recover          losses found by the reader; repair of a cut or damaged log
check/                   faults of a log: of its schemas, of each channel (for evidence too), and all of them together
topic_watch              missing messages, duplicates and clock jumps of one topic
watches/                 events and percentiles of a log, in a memory that does not grow
in_charge                when the rig had no controller
finding                  one fault of a log or of evidence, and its place
metadata                 configurations and versions that the processes of a run wrote into its log
pause_writer             writing the computer's stalls into the log that is being recorded, in the time of its run
"""
