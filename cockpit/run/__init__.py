"""A run and its replay.

scenario, scenario_file     what a run is made of; its files as tables
run                         one run, from its scenario to its verdict
in_process, closed_loop     in one process, without a bus; plant and controller in turns, compiled
processes, child_process    as several processes: started, watched, ended; how each behaves
progress, operator, status  the progress line; a person's stop or reset on its way; what goes on at a rig
replay, log_to_bus          a log through today's controller; a log back on the bus
authority                   the certificates of the roles
without                     the same run without its controller
writable                    files that a command writes at its end
"""
