"""silo-tui: the terminal configurator and live monitor of silo."""
