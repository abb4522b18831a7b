"""Measured runs, read strictly: doubtful data is reported as a finding, unusable data is refused.

manifest, manifest_text               the keys of `manifest.toml`; a manifest written as text
folder                                an evidence folder: its rig and its runs
column_checks                         which samples and columns can be used
sentinels                             values of a column that are no measurement
sign_and_unit                         the stiffness that force and acceleration show: a wrong sign, a wrong unit
force_pickup, exciter_harmonics       vibration in the force that no spring carries; a base that does not shake with a sine
lock_in                               amplitude of a signal at the commanded vibration
run_log, import_table                 run logs, and files of other programs, as evidence
"""
