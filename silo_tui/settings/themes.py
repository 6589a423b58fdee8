"""What the themes are called; alone, because the command line tells them before anything is imported."""

THEMES = ("dark", "light", "contrast", "16")
