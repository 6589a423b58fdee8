"""What is computed with samples of signals.

Arithmetic with units, NumPy's functions, calculus, spectra, frames, tables.
"""
