"""The colours of silo-tui: calm, few, and never the only sign of a state.

Roles: `foreground` text, `quiet` units and titles, `primary` focus and keys, `success` runs, `warning` pending,
`error` dead and lost, `secondary` marks, `plot` curves; on `background`, `panel` (bars), `boost` (lines to type in) and
`line` (under the cursor). Each is told from its grounds by a contrast of 4.5 (WCAG), in `silo-contrast` by 7.
"""

import os
from collections.abc import Container

from textual.theme import Theme


def _theme(name: str, *, dark: bool, grounds: tuple[str, str, str, str], roles: dict[str, str], lines: str) -> Theme:
    """Return a theme; `grounds` are background, panel, boost and the line under the cursor."""
    background, panel, boost, line = grounds
    return Theme(
        name=name,
        primary=roles["focus"],
        secondary=roles["mark"],
        accent=roles["caution"],
        success=roles["good"],
        warning=roles["caution"],
        error=roles["bad"],
        foreground=roles["text"],
        background=background,
        surface=background,
        panel=panel,
        boost=boost,
        dark=dark,
        variables={
            "block-cursor-background": line,
            "block-cursor-foreground": roles["text"],
            "border": lines,
            "border-blurred": lines,
            "scrollbar": lines,
            "scrollbar-hover": roles["quiet"],
            "scrollbar-active": roles["focus"],
            "scrollbar-background": background,
            "scrollbar-background-hover": background,
            "scrollbar-background-active": background,
            "scrollbar-corner-color": background,
            "input-selection-background": line,
            "line": line,
            "quiet": roles["quiet"],
            "plot": roles["data"],
        },
    )


DARK = _theme(
    "silo-dark",
    dark=True,
    grounds=("#12161b", "#1b2129", "#232a33", "#243448"),
    roles={
        "text": "#c5ced8", "quiet": "#8d9aa8", "focus": "#6cabf7", "good": "#6bb36f", "caution": "#e0a458",
        "bad": "#f08a7f", "mark": "#6bc1c9", "data": "#6cb2eb",
    },
    lines="#3a4552",
)  # fmt: skip
LIGHT = _theme(
    "silo-light",
    dark=False,
    grounds=("#fbfbfa", "#eeeeec", "#e6e6e3", "#d6e4f5"),
    roles={
        "text": "#24292f", "quiet": "#56606b", "focus": "#1d559c", "good": "#1f6426", "caution": "#7d4d00",
        "bad": "#a32d23", "mark": "#0f636b", "data": "#2059a3",
    },
    lines="#b9bfc6",
)  # fmt: skip
CONTRAST = _theme(
    "silo-contrast",
    dark=True,
    grounds=("#000000", "#141414", "#262626", "#003a70"),
    roles={
        "text": "#ffffff", "quiet": "#d6d6d6", "focus": "#8cc8ff", "good": "#7dff7d", "caution": "#ffd75f",
        "bad": "#ffb3ab", "mark": "#7df0ff", "data": "#8cd5ff",
    },
    lines="#ffffff",
)  # fmt: skip
# The terminal's own sixteen: neither bright black, unseen in Solarized, nor dark blue, unseen on black. What can't be
# told by a colour is told by `:ansi` rules in silo.tcss: quiet is dim, the line under the cursor reversed.
SIXTEEN = Theme(
    name="silo-16",
    ansi=True,
    primary="ansi_bright_blue",
    secondary="ansi_cyan",
    accent="ansi_yellow",
    success="ansi_green",
    warning="ansi_yellow",
    error="ansi_bright_red",
    foreground="ansi_default",
    background="ansi_default",
    surface="ansi_default",
    panel="ansi_default",
    boost="ansi_default",
    dark=True,
    variables={
        "ansi-background": "ansi_default",
        "ansi-foreground": "ansi_default",
        "block-cursor-background": "ansi_default",
        "block-cursor-foreground": "ansi_default",
        "block-cursor-text-style": "reverse",
        "border": "ansi_default",
        "border-blurred": "ansi_default",
        "input-cursor-background": "ansi_default",
        "input-cursor-foreground": "ansi_default",
        "input-cursor-text-style": "reverse",
        "input-selection-background": "ansi_bright_blue",
        "input-selection-foreground": "ansi_black",
        "scrollbar": "ansi_default",
        "scrollbar-hover": "ansi_bright_blue",
        "scrollbar-active": "ansi_bright_blue",
        "scrollbar-background": "ansi_default",
        "scrollbar-background-hover": "ansi_default",
        "scrollbar-background-active": "ansi_default",
        "scrollbar-corner-color": "ansi_default",
        "line": "ansi_default",
        "quiet": "ansi_default",
        "plot": "ansi_bright_cyan",
    },
)
THEMES = (DARK, LIGHT, CONTRAST, SIXTEEN)
# themes of Textual's own know nothing of ours
FALLBACK = {"line": "ansi_default", "quiet": "ansi_default", "plot": "ansi_bright_cyan"}


def theme_name(word: str) -> str:
    """Return what Textual calls a theme: `silo-dark` for `dark`."""
    return f"silo-{word}"


def chosen(word: str, available: Container[str]) -> str:
    """Return the theme to begin with: `TEXTUAL_THEME` if it is set and there, else that of the settings."""
    wanted = os.environ.get("TEXTUAL_THEME", "")
    return wanted if wanted in available else theme_name(word)
