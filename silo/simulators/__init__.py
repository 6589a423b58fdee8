"""What simulators know of their variables, for `log.add`, and environments that log their episodes."""
