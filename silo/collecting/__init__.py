"""Collecting: from variables in the robot program to rows in a shared memory segment, and the reader of those rows.

Knows neither Zenoh nor files nor loggers. `silo/logger/` writes through it, `silo/helper/` reads through it.
"""
