"""What programs write in calls of a logger: what the arguments may be, under which names, and what they become."""
