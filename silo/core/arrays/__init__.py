"""Samples as numbers and as columns of minimum and maximum: the only nouns that load NumPy."""
