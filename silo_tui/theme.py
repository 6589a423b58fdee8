"""The colours of silo-tui: calm, few, and never the only sign of a state."""

import os

from textual.theme import Theme

DARK = Theme(
    name="silo-dark",
    primary="#539bf5",
    secondary="#6bc1c9",
    accent="#e0a458",
    success="#6bb36f",
    warning="#e0a458",
    error="#ec7468",
    foreground="#c5ced8",
    background="#12161b",
    surface="#12161b",
    panel="#1b2129",
    boost="#232a33",
    dark=True,
    variables={
        "block-cursor-background": "#243448",
        "block-cursor-foreground": "#ffffff",
        "border": "#3a4552",
        "border-blurred": "#2a323c",
        "scrollbar": "#2f3944",
        "scrollbar-hover": "#3a4552",
        "scrollbar-active": "#539bf5",
        "scrollbar-background": "#12161b",
        "scrollbar-background-hover": "#12161b",
        "scrollbar-background-active": "#12161b",
        "scrollbar-corner-color": "#12161b",
        "input-selection-background": "#2d4a6b",
        "line": "#243448",
        "quiet": "#7d8a98",
        "plot": "#6cb2eb",
    },
)
LIGHT = Theme(
    name="silo-light",
    primary="#2563b0",
    secondary="#187d86",
    accent="#9a5f00",
    success="#2f7d36",
    warning="#9a5f00",
    error="#b93a2f",
    foreground="#24292f",
    background="#fbfbfa",
    surface="#fbfbfa",
    panel="#eeeeec",
    boost="#e6e6e3",
    dark=False,
    variables={
        "block-cursor-background": "#d6e4f5",
        "block-cursor-foreground": "#000000",
        "border": "#b9bfc6",
        "border-blurred": "#d5d9de",
        "scrollbar": "#c9ced4",
        "scrollbar-background": "#fbfbfa",
        "line": "#d6e4f5",
        "quiet": "#6b7682",
        "plot": "#2563b0",
    },
)
THEMES = (DARK, LIGHT)
# themes of Textual's own know nothing of ours
FALLBACK = {"line": "ansi_blue", "quiet": "ansi_bright_black", "plot": "ansi_bright_cyan"}


def chosen() -> str:
    """Return the theme to begin with: `TEXTUAL_THEME` if it is set, else ours."""
    return os.environ.get("TEXTUAL_THEME") or DARK.name
