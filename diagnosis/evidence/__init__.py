"""Measured runs, checked strictly: doubtful data is reported as a finding, unusable data is refused.

manifest                              the keys and the text of `manifest.toml`
folder                                an evidence folder: its rig and its runs
column_checks                         which samples and columns can be used
foreign_vibration                     vibration in the force that no spring carries; base vibration that is not a sine
run_log, import_table                 run logs, and files of other programs, as evidence
assumed                               values for rig numbers that a manifest or a channel map omits
manifest_keys                         keys that a manifest and a channel map share
mapped                                the standard columns of a table, without values that mean "no measurement"
conversion                            a rotary rig as a rig that slides; further columns merged into the standard columns
split                                 one long run as two parts; long records shortened for simulation
unknown_mass                          estimate of a mass that the owner cannot weigh
"""
