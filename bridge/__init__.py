"""All input and output of the project: everything that crosses a process border.

wire/     messages on the bus, for every language: stickslip.proto, PROTOCOL.md, topics, the Zenoh link, scheduling
log/      run logs (MCAP): written, recorded, read whole or cut, checked
rig/      a rig of any kind behind its guard, as a process: the contract of a device, injected faults
guard/    limits on the exciter of a rig that hold for every command of a controller
fmu/      kernels as FMUs for other tools
tables/   CSV, Parquet, MATLAB and TDMS, in and out
config    strict TOML                              faults   codes, exit statuses and help (faults.toml)
files     checks before reading, atomic writing    units    units in names, numbers in words
results   the JSON of results: a named tuple is an object
pages     one style sheet and one frame for all HTML files
provenance  origin of a page or a picture: version, command, date, hashes
kernel, kernel_cache  compiled code; its place on disk and its renewal   layouts   fields of its records
kernel_linking  how kernels that call each other are compiled once
compiling  the progress of compilation, and signals during it
plain, processes  text that is safe on a terminal; the identity of a process
threads   work that a thread repeats
formula   arithmetic of a fixed grammar over named values, in files of users
arrays    names for the types of arrays

"""
