"""What crosses a process border, and the only input and output of the project.

on the wire   stickslip.proto, messages, topics, zenoh_link; PROTOCOL.md describes it for other languages
in the log    mcap_chunks and runlog write, recorder is the process, log_reader and logfile read, whole or cut
as tables     export, table_writers, matfile write; tables reads CSV, Parquet, MATLAB and TDMS; units names units
for everyone  config (strict TOML), reading (what cannot be read), faults (codes and help), kernel (compiled code), realtime
              (scheduling)
"""
