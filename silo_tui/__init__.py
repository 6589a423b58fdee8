"""silo-tui: the terminal configurator and live monitor of silo.

Imports run one way: model < sessions < widgets < context < screens < commands < app < cli. `actions`, `theme` and
`terminal` import nothing of `silo_tui`; all above `sessions` may import them. `silo` never imports this.
"""
