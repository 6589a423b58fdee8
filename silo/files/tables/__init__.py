"""Recordings as arrays and tables of other programs: NumPy, MATLAB, HDF5, Parquet."""
