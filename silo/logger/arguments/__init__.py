"""What programs write as arguments of a logger: what they may be, under which names, and what they become."""
