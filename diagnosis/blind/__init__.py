"""How good the diagnosis is, measured so that it cannot cheat: sealed answers, one run, one score.

sealing         a set of cases, the hashes of its answers, the key apart, and whether the set was opened
version         the version that a result belongs to: a hash over what makes a diagnosis
running         every case diagnosed, without the key
opening         hashes checked, answers opened, all methods scored
outcomes        one case opened: its answer beside what the tool said
intervals       rates with Wilson's interval, means and ratios with the bootstrap's
calibration     whether 80 % means 80 %
locating        whether the gap was found where the effect is
scoring         all scores of one method over one set
baselines       simpler methods that answer from what the diagnosis computed anyway
oracle          what the true effect closes, when somebody tells its name
trees           a tree ensemble on the same features, trained on the twin
table, report   the scores as text; as one HTML file with pictures (template: report.html.j2)
"""
