"""Parts of the MCAP format for the reader of logs.

chunk_bytes   one chunk of any compression, unpacked and checked; search for the next whole chunk after damage
definitions   schemas and channels of a file: the topic of each channel, and whether it belongs to this project
"""
