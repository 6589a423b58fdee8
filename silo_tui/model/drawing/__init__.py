"""What is drawn: dots, curves, axes, the window that plots share. Plain Python and NumPy."""
