"""What crosses a process border, and the only input and output of the project.

wire/     messages on the bus, for every language: stickslip.proto, PROTOCOL.md, topics, the Zenoh link, scheduling
log/      run logs (MCAP): written, recorded, read whole or cut, checked
guard/    what the exciter of a rig may do, whatever a controller commands
tables/   CSV, Parquet, MATLAB and TDMS, in and out

config    strict TOML                              faults   codes, exit statuses and help
files     checks before reading, atomic writing    units    units in names, numbers in words
provenance   what made a page or a picture: version, command, date, hashes
kernel, kernel_cache   compiled code; where it is kept, and when it is renewed
kernel_linking   how kernels that call each other are compiled once
compiling   the progress of compilation, and signals during it
plain, processes   text that is safe on a terminal; the identity of a process
"""
