"""What users ask for that takes more than one step: apply, restart, leave, open, the command line, the palette."""
