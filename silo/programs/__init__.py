"""Programs that log through silo as users do: the simulated robot of `silo demo`, and `silo host`."""
