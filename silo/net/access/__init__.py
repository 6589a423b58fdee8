"""Who may do what over a network, and why a way to a robot fails."""
