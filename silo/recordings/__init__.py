"""Saved logs on the robot: written, listed, read in pieces, deleted, held against one another."""
