"""Amounts of samples, seconds and bytes: one way to read them, one to write them."""
