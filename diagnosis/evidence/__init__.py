"""Measured runs, read strictly: doubtful data is reported as a finding, unusable data is refused.

manifest, manifest_text               the keys of `manifest.toml`; a manifest written as text
folder                                an evidence folder: its rig and its runs
column_checks                         which samples and columns can be used
sentinels                             values that a program writes in place of a measurement
sign_and_unit                         the stiffness that force and acceleration show: a wrong sign, a wrong unit
force_pickup, exciter_harmonics       vibration in the force that no spring carries; a base that does not shake with a sine
lock_in                               amplitude of a signal at the commanded vibration
run_log, import_table                 run logs, and files of other programs, as evidence
assumed                               values for rig numbers that a manifest or a channel map omits
beside                                columns that some rigs measure besides, brought into the standard ones
manifest_keys                         keys that a manifest and a channel map share
mapped                                the standard columns of a table
rotary                                a rig that turns, converted to a rig that slides at a radius
split                                 one long run as two parts
unknown_mass                          the mass that the runs show, for an owner who cannot weigh it
"""
