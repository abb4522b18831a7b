"""Options and output of each `stickslip` command; `cockpit.cli` lists them.

processes                   run: plant, controller and recorder together; plant, controller, record: one of them
operator_commands           arm, disarm, stop, reset, status
live                        serve, watch
proof                       fault, soak, schema
testing, fmu                test: scenarios with expectations; fmu: a rig or a controller as a model for other tools
replay                      a log through this version's controller, simulated again, or published on the bus
pictures                    plot, review, map, reproduce
look                        estimates from a measured file
log                         info, check, recover, export, import
example                     evidence of a simulated rig
diagnose, diagnose_output   a diagnosis from evidence; its progress and its text on a terminal
explain, scenarios          meanings of codes; shipped scenarios and rigs
certs                       certificates for a bus beyond one computer
moved                       names of commands that left the package
as_json/                    `--json` of every command, and the JSON Schema of every format, from the types of the results
options                     options that several commands share
"""
