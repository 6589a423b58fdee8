"""Collecting: from variables in the robot program to rows in a shared memory segment, and the reader of those rows.

Segments, the journal beside them, and what dead processes left of both. Knows neither Zenoh nor log files nor loggers.
`silo/logger/` writes through it, `silo/helper/` reads through it.
"""
