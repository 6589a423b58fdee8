"""Runs as training data: frames at one rate, episodes, statistics; written as a LeRobot data set, and checked."""
