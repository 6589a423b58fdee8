"""The shared memory segment of a run: its layout, who writes it, who reads it, and the rows between."""
