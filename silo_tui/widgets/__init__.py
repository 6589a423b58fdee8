"""The widgets of silo-tui: they draw the state of `silo_tui.model` and post messages."""
