"""Screens of plots, live or of files."""
