"""From variables in the robot program to rows: sources, types, plan, the generated `collect()`, one run."""
