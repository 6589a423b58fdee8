"""Colours of signals that share a plot; letters tell them apart as well."""

from functools import cache

from rich.style import Style
from textual.app import App

# what becomes 14, 11, 13, 10, 9, 12, 15, 6 of 16 colours; no bright black (unseen in Solarized), no dark blue
_IN_16 = ("#55ffff", "#ffff55", "#ff55ff", "#55ff55", "#ff5555", "#5555ff", "#ffffff", "#00aaaa")
_DARK = ("#6cb2eb", "#e8c55a", "#d58ff0", "#7fd18b", "#f07f74", "#8b9cff", "#f2f2f2", "#3fa7a0")
_LIGHT = ("#2563b0", "#8a6500", "#8b2fa8", "#2f7d36", "#b93a2f", "#4a4ae0", "#202020", "#0e7c78")


def series_style(app: App[object], place: int) -> Style:
    """Return the colour of the signal at a place in its plot, in as many colours as the terminal has."""
    return _style(place % len(_IN_16), app.console.color_system == "standard", app.current_theme.dark)


def most_series(app: App[object], most: int) -> int:
    """Return how many curves can be told apart in one plot: two without colours."""
    return 2 if app.no_color else most


@cache
def _style(place: int, few: bool, dark: bool) -> Style:
    colors = _IN_16 if few else _DARK if dark else _LIGHT
    return Style(color=colors[place])
