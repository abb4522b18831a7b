"""What a record says, whoever made it: from an evidence folder to where the gap between rig and model lies, and why.

Evidence in
    manifest, manifest_text     what `manifest.toml` may say; the same as text
    evidence, evidence_checks   a folder read strictly; which samples and columns can be used
    bending                     the drive's stiffness as force and acceleration tell it: a wrong sign, a wrong unit
    pick_up, distortion         a vibration in the force signal that no spring carries; a base that shakes with no sine
    lock_in                     how strongly a signal swings at the commanded vibration
    log_evidence, importing     run logs, and files of other programs, as evidence
    findings                    one thing that is wrong, and where
Comparison
    reduced                     a run on the 1 ms grid
    commands                    what the rig was told, and the segments in which that does not change
    axis_motion                 the measured motion along which a force-driven model is led
    twin                        one run predicted under the run's own commands, by the plant's equations
    side_by_side, lanes         four rigs through it at once; one step of them
    sensing                     what sensors make of a prediction: faults, and ordinary lags
    axis_drive                  a force-driven axis: the true input, freed of what its sensor did to it
    entries                     the force and the state with which every segment of the model begins
    noise                       the noise of a run, taken from the run
    cycles                      slips, breakaways and re-sticks of a force record
    features, axis_features     a run in numbers that do not depend on when it slips; the same for a force-driven axis
    spring_law                  how the force follows the extension of the spring
    problem                     the runs of an evidence, ready: measured features, and predicted ones at any point
    gap                         the gap, its floor and its definition
Fit
    nuisance                    what may differ without being a gap, in units of its tolerance
    library                     every effect in every formula, with coordinates and starts
    waves, axis_waves           periods at which a wave may be looked for
    ringing                     frequencies at which a structure that rings may be looked for
    by_run                      parameters of an effect that differ from run to run
    phases, phases_by_run       a wave over time that begins in another phase in every run; where its refit starts
    late_friction               where the refit of friction starts that lags by much
    retuning                    the rig without effects, refitted: what all evidence is measured against
    form                        effects in given formulas, and their free parameters as coordinates
    refit                       Gauss-Newton over nuisances and the parameters of an effect
    together                    many fits at once, whose predictions go side by side
    random_friction             friction without a path that could be followed: judged by what it scatters
    workers                     the same work on many items, in as many processes as one wants
    search                      from all trials to the few that are refitted in full
Verdict
    diagnose                    the whole way, in order
    second_floor                once more on the floors of the nearest model, where nothing explains it
    assembling                  what came out of it, put together
    verdict                     is there a gap, which effect closes it, how sure that is
    imitation                   which effects these runs cannot tell apart
    heldout                     how far the gap closes on runs that no fit has seen, and which names they refute
    flexible                    what a blend of all effects would close, to compare with
    experiments, advice         runs that could be measured next; checks by hand
    next_experiment             which of them separates the leading explanations
    many                        many folders: on the cores of a machine, or on a Dask cluster
Output
    result                      the answer and its JSON
    wording, summary            numbers and effects in words; the answer in sentences
    report, report_plots        one HTML file (template: report.html.j2); its pictures as PNG
    pictures, cycle_pictures    which pictures; cycles laid over their predictions
    residual_pictures           residuals over what explains them,
    residual_axes               and which residual over which variable
    strict_json                 JSON files that any reader takes
    parity, kinematics          relations between channels that need no simulation; the motion and derivatives they need
    breakaways                  breakaways, and what each could depend on
    apply                       a rig file with the named effects
How good it is
    blind                       sealed cases, one run, one score: a package of its own
Evidence made from the plant
    making                      a described rig, and a drawn one that is measured
    made_runs, made_sensors     one run of it; what its measuring chain adds
    protocols                   which runs are measured, by name
Run logs
    logcheck, topic_watch       what is wrong with a log: all of it; the numbers and times of one topic
    signal_checks               range, clipping and dead stretches of one signal, for logs and evidence
"""
