"""Runs held against rules and against a run that was good: `silo check --against`, the fixture `silo_runs`."""
