"""`python -m silo.cli`."""

from silo.cli import main

main()
