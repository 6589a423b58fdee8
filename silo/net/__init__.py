"""The network: keys, Zenoh sessions, their configuration."""
