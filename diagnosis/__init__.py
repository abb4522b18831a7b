"""What a record says, whoever made it: the way to where the gap between rig and model lies.

cycles                                          slips, breakaways and re-sticks of a force record
evidence, manifest, evidence_checks             the evidence folder: loaded strictly, its faults reported
importing, manifest_text, log_evidence          foreign files, and run logs, made into evidence
logcheck, topic_watch, signal_checks, findings  what is wrong with a log
"""
