"""Captures: the rows of a trigger from the moment it fires until they stand in files."""
