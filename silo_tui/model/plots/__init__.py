"""What stands in plots besides their curves: panels, limits, overlays, facts. Plain Python and NumPy."""
