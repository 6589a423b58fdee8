"""Collecting: from variables in the robot program to rows in a shared memory segment. Knows neither Zenoh nor files."""
