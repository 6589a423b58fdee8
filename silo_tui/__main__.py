"""`python -m silo_tui`."""

from silo_tui.cli import main

main()
