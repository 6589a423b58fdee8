"""Where the data comes from: a live logger over its link, or a recorded file; finding and starting them.

Sessions import `model` and `silo`, know no widget and draw nothing. Zenoh is reached only through `silo.client` and
`silo.fleet`, and only when a logger is looked for. Widgets, screens and commands import this.
"""
