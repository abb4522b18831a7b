"""The files of a log, and proof that no byte was changed.

chain        a hash over all bytes, link by link
parts        the files that belong to one log
part_file    one file that is being written
log_files    the next file after a full, lost or long file
afterwards   a table added to a closed log
"""
