"""Accuracy of the diagnosis, measured so that it cannot cheat: sealed answers, one run, one score.

sealing         a set of cases, the hashes of its answers, the key in another place, and whether the set was opened
running         every case diagnosed, without the key
opening         hashes checked, answers opened, all methods scored
outcomes        one opened case: its answer and the result of the diagnosis
intervals       rates with Wilson's interval, means and ratios with the interval of the bootstrap
calibration     whether 80 % means 80 %
locating        whether the diagnosis finds the gap where the effect is
scoring         all scores of one method over one set
rivals          the methods of `python -m bench judge` on the same cases
oracle          how far the true effects close the gap when their names are known
pooling         kept scores of several sets read and scored together
table, report   the scores as text; as one HTML file with pictures (template: report.html.j2)
command         the command line, `python -m bench blind`
"""
