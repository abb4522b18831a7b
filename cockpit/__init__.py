"""What a person touches: the `stickslip` command. The only package that knows both the controller and the plant.

cli, log_commands, ..._command   the commands; options: what several of them have
scenario, running, verdict       what a run is made of, one run, what came of it
orchestra, processes, live       a run of several processes, how each behaves, its progress line
operator_word                    a person's stop or reset on its way
onboard                          a run in one process
replaying, to_bus                a log replayed, a log back on the bus
run_plot, stability_map          pictures
reproduce, reproduce_*           the paper redone
"""
