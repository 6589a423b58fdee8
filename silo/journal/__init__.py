"""A recording on the disk that survives a power cut: its format, writer and reader, and the folders that have one."""
