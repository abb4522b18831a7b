"""What the reader of logs needs of the MCAP format.

chunk_bytes   one chunk: unpacked and checked, whatever its compression; the next whole one after damage
definitions   schemas and channels of a file: which topic a channel is, and whose
"""
