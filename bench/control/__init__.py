"""The bench of the controller: many simulated rigs, judged by their true motion and compared with simple rules.

scenario.py   a scenario of the bank, read from bench/control/scenarios
rules.py      the rivals: simple rules with the interface of the controller's step
loop.py       a rig and its controller, or a rival, in compiled code that keeps the truth
record.py     parameters and memory of the judge of a run
motion.py     sticks, slips and surges of the true motion; the definitions are in docs/method/bank.md
answer.py     the controller's response: announcements, false claims, sums over the run
watch.py      a stretch of a run, judged by motion.py and answer.py
run.py        one scenario with one subject, to its end
figures.py    the figures of a run, compared with the scenario's expectation
oracle.py     the least constant v_a / v_d that leaves no slip; the best that any controller can do, where ours slips
suite.py      all scenarios and subjects, in processes
cost.py       time of a controller step
bars.py       the figures of all runs against their bars
result.py     the whole bench: as a result, as JSON, in words
axes_map.py   for which axes the controller works: stiffness, feed, noise and delay in a picture
page.py       one HTML page: the table first, then the failures
command.py    the command line, `python -m bench control`
drawn         axes drawn at random
trust/        drawn axes, axes that never stick, disturbed runs and re-sticks: `python -m bench trust`
plots         a failed run as a picture
"""
