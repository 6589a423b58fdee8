"""Talking to loggers: messages, keys, the Zenoh session, the client."""
