"""What stands in a log folder, held against one another: what is missing, twice, or told wrongly."""
