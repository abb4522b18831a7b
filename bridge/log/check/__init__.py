"""Checks of a log: bytes, schemas, ranges of the signals, and all findings together in `log_check`.
channel          faults of a single channel
schema_check     check of the schemas in a log, by which other programs read its messages
signal_range     range, clipping and dead stretches of a signal, found piece by piece with a memory of a few numbers
"""
