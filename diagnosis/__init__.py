"""From an evidence folder to where the gap between rig and model lies, and why.

diagnose        the whole way, in order             result      the answer and its JSON
diagnose_many   many folders, on cores or Dask      processes   the same work in any number of processes

On the way, each room on what stands before it:

evidence/      a folder of measured runs, read strictly
features/      a run as numbers that do not depend on when it slips
model/         one run predicted under the run's own commands, as its sensors would show it
gap/           measured against predicted, in noise floors
hypotheses/    what is tried: nuisances, effects in every form, where they start
fits/          refits: one, many at once, the search over all
verdict/       is there a gap, which effect, how sure, and what the held-out runs say
experiments/   what to measure next, what to check by hand
pictures/      measured beside predicted as curves; residuals over what explains them
report/        the answer in words, as a page, as a rig file
synthetic/     evidence made from the plant
blind/         how good all of it is: sealed cases
"""
