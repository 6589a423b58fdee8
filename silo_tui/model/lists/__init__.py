"""What list screens show: lines of text, their order, filter and marks. Plain Python and NumPy."""
