"""What a person touches: the `stickslip` command, runs of several processes, verdicts, plots and pages.

`cli` the command, `scenario` what a run is made of, `orchestra` the processes of a run, `onboard` a run in one process,
`verdict` what came of it. The only package that knows both the controller and the plant.
"""
