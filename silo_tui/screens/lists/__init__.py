"""Screens that are lists."""
