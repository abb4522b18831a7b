"""The `stickslip` command. The only package that imports both the controller and the plant.

cli         all commands            commands/   one file per group of commands
run/        a run, on the bus or in one process; replay of a log
fleet/      diagnosis of many rigs, each once, and the rigs that share a gap
judge/      the verdict on a run, in numbers and words
figures/    a log as a figure               review/     a log as a page
paper/      the paper recomputed
faults/     catalogue of faults             expect/     expectations on a run, judged on its log
testing/    `stickslip test`
live/       a running rig, live
look/       `stickslip look`
entry       entry point of the `stickslip` command
first_stop  the stop by file, before all else
"""
