"""The helper process: answers clients, publishes, saves, and outlives a robot process that died."""
