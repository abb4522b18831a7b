"""From an evidence folder to the place and the cause of the gap between rig and model.

diagnose        all steps of a diagnosis, in order  result      the answer and its JSON
diagnose_many   many folders, on cores or Dask      threads     one for linear algebra, several for simulations
deadline        the estimate of the time, and its end by the budget or by Ctrl-C
version         the version of a result: a hash over the definitions that make a diagnosis
slips           turning points of a record, and the slips of a force record

The packages, each built on those before it:

look/           slips and friction numbers of one measured record
evidence/       a folder of measured runs, read strictly
features/       a run as numbers that do not depend on the instants of its slips
model/          prediction of one run under the commands of that run, as its sensors would show it
synthetic/      evidence made from the plant
gap/            measured features against predicted features, in noise floors
relations/      relations between channels as regressions over all samples, without a simulation; share of each cause
latent/         latent friction: shares of place, direction, time, speed and load in the friction, as predictions
hypotheses/     nuisances, effects in every form, and the points where their fits start
fits/           refits: a single fit, many at once, the search over all effects
pictures/       measured and predicted curves; residuals over the variable that explains them
judge/          all witnesses, the ledger of their log evidence, and the judge: which effects, and whether anything else acts
experiments/    the next run to measure, and checks by hand
report/         the answer in words, as a page, as a rig file; the shares come from relations and latent
"""
