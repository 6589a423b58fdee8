"""Who may change a logger: who a sender is, who has control, what was denied."""
