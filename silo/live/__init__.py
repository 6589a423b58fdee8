"""What a client shows as it happens: views, streams and topics, and who publishes them; it never waits for a client."""
