"""Conditions on the rows that are recorded: expressions, triggers, limits.

Pure: all of it takes arrays and returns values, knows no ring, no file, no process, and gives the same results however
the rows are cut into batches.
"""
