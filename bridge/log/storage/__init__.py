"""The files of a log, and the proof that no byte was changed.

parts          the files that belong to one log
part_file      one file that is being written, and its lock
log_files      the next file after a full, lost or long file
checksums      digest and checksums of a whole log
verdict_file   the verdict in a file next to the log
"""
