"""MCAP files as such: records, chunks, indices, whatever is in the messages."""
