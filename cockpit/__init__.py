"""What a person touches: the `stickslip` command. The only package that knows both the controller and the plant.

cli         all commands            commands/   one file a group of commands
run/        a run, on the bus or in one process; a log replayed
bank/       the bench of the controller: many made rigs, judged by what truly happens on them
fleet/      many rigs diagnosed, each once, and which of them share a gap
judge/      what came of a run, in numbers and words
figures/    a log as a figure               review/     a log as a page
paper/      the paper redone
"""
