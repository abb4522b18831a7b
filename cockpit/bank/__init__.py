"""The bench of the controller: many made rigs, judged by what truly happens on them, beside rules that need no controller.

scenario.py   a scenario of the bank, read from deploy/scenarios/bank
rules.py      the rivals: simple rules with the interface of the controller's step
loop.py       a rig and its controller, or a rival, in compiled code that keeps the truth
record.py     the numbers and the memory of the judge of a run
motion.py     sticks, slips and surges of the true motion; the definitions are in docs/method/bank.md
answer.py     what the controller made of it: announcements, false claims, sums over the run
watch.py      a stretch of a run judged with both
run.py        one scenario with one subject, to its end
figures.py    what a run comes to, and whether it is as the scenario expects
least.py      the least constant v_a / v_d that leaves no slip
oracle.py     the best that any controller can do, where ours slips
suite.py      all scenarios and subjects, in processes
cost.py       what a step of the controller costs
bars.py       the figures of all runs against their bars
result.py     the whole bench: as a result, as JSON, in words
axes_map.py   for which axes it works: stiffness, feed, noise and delay in a picture
page.py       one page: the table first, then what failed
"""
