"""The rules of limits and triggers: when a value is beyond a bound, when a trigger fires, what a capture holds.

Pure: all of it takes arrays and returns values, knows no ring, no file, no process, and gives the same results however
the rows are cut into batches.
"""
