"""Every method that names a cause, on cases with known answers: `python -m bench judge`.

`python -m tests.blind develop` makes the cases. A method is a function from an evidence folder to the probabilities of names, of
`none` (the rig as described) and of `outside` (an effect that the library lacks); two effects at once are `one + other`.

cases      cases and their answers; the fixed halves: designs are developed on half a and decided on half b
methods    the methods by name, and their kept answers: a method that did not change is not asked again
refits     the verdict of the diagnosis, and BIC over single refits of an earlier version, from kept fits (fits.json.gz)
lines      straight lines over all samples, ranked by evidence
columns    their columns, by relation
trees      trees on rigs that the plant simulates under the campaign at hand
features   the inputs of the trees
training   the numbers of the judge, from simulated rigs; campaigns, rigs: the rigs and their runs
scoring    right, wrong and cost of every method
command    the command line
"""
