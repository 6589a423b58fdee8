"""Commands on limits, triggers and derived signals."""
