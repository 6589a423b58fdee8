"""Values that are tuned: what they may be, how they changed, how they are excited."""
