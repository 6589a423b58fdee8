"""Parameters that are tuned while the robot runs: what is asked of them, who stores them, how changes land in the loop.

Rules and values are those of `silo/core/tuning/parameters.py`; what was changed is recorded by
`silo/segment/parameter_changes.py`.
"""
