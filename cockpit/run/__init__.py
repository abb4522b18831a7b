"""A run and its replay.

scenario                    what a run is made of
run                         one run, from its scenario to its verdict
in_process, closed_loop     in one process, without a bus; plant and controller in turns, compiled
processes, child_process    as several processes: started, watched, ended; how each behaves
progress, operator          the progress line; a person's stop or reset on its way
replay, log_to_bus          a log through today's controller; a log back on the bus
writable                    files that a command writes at its end
"""
