"""Benchmarks of controller, guard and diagnosis, run in a clone of the repository: `python -m bench`.

control/  the controller on many simulated axes, compared with simple rules (docs/method/bank.md)
faults/   rig and controller under the faults of deploy/faults (docs/quality/results.md)
blind/    the diagnosis on cases with sealed answers (docs/quality/results.md)
judge/    the diagnosis and its rivals on cases with known answers (docs/method/diagnosis.md)
app       the command line
schemas   the JSON Schemas of its files and results, kept in bench/json_schemas
"""
