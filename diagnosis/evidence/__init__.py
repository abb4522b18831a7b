"""Measured runs, read strictly: what is doubtful is said, what cannot be used is refused.

manifest, manifest_text               what `manifest.toml` may say; the same as text
folder                                an evidence folder: its rig and its runs
column_checks                         which samples and columns can be used
sign_and_unit                         the stiffness that force and acceleration tell: a wrong sign, a wrong unit
force_pickup, exciter_harmonics       vibration in the force that no spring carries; a base that shakes with no sine
lock_in                               how strongly a signal swings at the commanded vibration
run_log, import_table                 run logs, and files of other programs, as evidence
"""
