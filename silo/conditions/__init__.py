"""Triggers, limits and derived signals: what is asked, and how they stand."""
