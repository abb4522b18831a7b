"""From an evidence folder to the place and the cause of the gap between rig and model.

diagnose        the whole way, in order             result      the answer and its JSON
diagnose_many   many folders, on cores or Dask      processes   the same work in any number of processes
evidence/       a folder of measured runs, read strictly
features/       a run as numbers that do not depend on the instants of its slips
model/          prediction of one run under the commands of that run, as its sensors would show it
gap/            measured features against predicted features, in noise floors
relations/      relations between channels as regressions over all samples, without a simulation
hypotheses/     nuisances, effects in every form, and the points where their fits start
fits/           refits: one, many at once, the search over all
verdict/        whether there is a gap, which effect closes it, how sure that is, and the check on held-out runs
experiments/    the next run to measure, and checks by hand
pictures/       measured and predicted curves; residuals over the variable that explains them
report/         the answer in words, as a page, as a rig file
synthetic/      evidence made from the plant
version         the version that a result belongs to: a hash over the definitions that make a diagnosis
latent/         latent friction
look/           stick-slip of one measured record at a glance

The packages, each built on those before it:

"""
