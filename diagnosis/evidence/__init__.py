"""Measured runs, checked strictly: doubtful data is reported as a finding, unusable data is refused.

manifest, manifest_text               the keys of `manifest.toml`; a manifest written as text
folder                                an evidence folder: its rig and its runs
column_checks                         which samples and columns can be used
sentinels                             values that a program writes in place of a measurement
sign_and_unit                         the stiffness from force and acceleration shows a wrong sign or unit
force_pickup, exciter_harmonics       vibration in the force that no spring carries; base vibration that is not a sine
lock_in                               amplitude of a signal at the commanded vibration
run_log, import_table                 run logs, and files of other programs, as evidence
assumed                               values for rig numbers that a manifest or a channel map omits
beside                                further columns of some rigs, merged into the standard columns
manifest_keys                         keys that a manifest and a channel map share
mapped                                the standard columns of a table
rotary                                a rotary rig, converted to a rig that slides at a radius
split                                 one long run as two parts
unknown_mass                          estimate of a mass that the owner cannot weigh
"""
