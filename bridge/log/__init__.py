"""Run logs: every message of a run in one MCAP file.

mcap_chunks, runlog      written in small chunks, so that a kill costs at most one
recorder                 the process that writes what is on the bus
log_reader, logfile      read without seeking, whole or cut; made whole again
log_check, topic_watch   what is wrong with a log: all of it; the numbers and times of one topic
signal_range             range, clipping and dead stretches of one signal, for logs and evidence
finding                  one thing that is wrong, and where
"""
