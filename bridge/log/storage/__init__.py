"""The files of a log, and proof that they are as they were written.

chain        a hash over all bytes, link by link
parts        which files belong to one log
part_file    one file that is being written
log_files    the next file where one is full, lost or long enough
afterwards   a table in a log that is closed
"""
