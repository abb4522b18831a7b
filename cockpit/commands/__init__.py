"""What each command of `stickslip` takes and prints; `cockpit.cli` puts them together.

run                         plant, controller and recorder in one go
processes                   one of them alone: plant, controller, record
person                      arm, disarm, stop, reset, status
stress                      a room: bench, fault, soak
replay                      a log through today's controller, simulated again, or back on the bus
pictures                    plot, review, map, reproduce
look                        what is in a measured file
log, blind                  groups of commands
example                     evidence of a made-up rig
diagnose, diagnose_output   evidence to a diagnosis; its progress and its words on a terminal
explain, scenarios          what there is to know without a run
certs                       certificates for a bus beyond one computer
schema                      prints the JSON Schema of a format
as_json/                    `--json` of every command, and the JSON Schema of every format, from the types of the results
options                     what several commands have
"""
