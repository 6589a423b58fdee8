"""What is written: numbers, times, names, paths, people as short text, and what is typed. Plain Python and NumPy."""
