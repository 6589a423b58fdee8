"""Endless recording: a process of its own per recorder, which writes rows of the rings to MCAP parts, for days.

It gets the segments as open files from the helper process, or from whoever starts it, and answers nobody but that one.
It knows no network and no logger. The helper process starts and watches recorders in `server`, `process` and `folder`.
"""
