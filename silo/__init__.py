"""silo: a signal logger for robots."""
