"""A run and its replay.

scenario, scenario_file     the model of a run of a simulated rig; its files as tables
run_tables, device_run      the tables that every run has; the model of a run of a real rig
step                        a change during a run, table [[step]]
sensor_needs                sensors that a scenario needs, checked before the run
run                         one run from its scenario to its verdict
in_process, closed_loop     in one process, without a bus; plant and controller in turns, compiled
simulated/                  in one process and simulated time, with faults of bus and processes
processes, child_process    as several processes: start, supervision, end, progress line; signals and faults of each
replay, log_to_bus          a log through this version's controller; a log published on the bus
soak                        a run of hours, with memory and latency
authority                   the certificates of the roles
writable                    checks of the files that a command writes at its end
"""
