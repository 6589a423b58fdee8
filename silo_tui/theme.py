"""The colours of silo-tui: calm, few, and never the only sign of a state.

Roles: `foreground` text, `quiet` units and titles, `primary` focus and keys, `success` runs, `plot` curves, and the
five of `ROLES`: `alarm` over a red limit, failed, lost, in conflict; `warning` over a yellow one, slow, full, blind,
stopped; `pending` edits that wait; `dead` what no longer answers, or ended; `selected` what is marked. Their signs
(`HH`, `H`, `*`, `×` and `~`, `+`) stand beside them without colours too. On `background`, `panel` (bars), `boost`
(lines to type in) and `line` (under the cursor). Each is told from its grounds by a contrast of 4.5 (WCAG), in
`silo-contrast` by 7. The colours of curves beside each other: `widgets/styled.py`.
"""

import os
from collections.abc import Container, Mapping
from types import MappingProxyType

from textual.theme import Theme

ROLES = ("alarm", "warning", "pending", "dead", "selected")
_OWN = "ansi_default"  # the terminal's


def _theme(
    name: str,
    *,
    dark: bool,
    grounds: tuple[str, str, str, str],
    roles: dict[str, str],
    lines: str,
    ansi: Mapping[str, str] = MappingProxyType({}),
) -> Theme:
    """Return a theme; `grounds` are background, panel, boost and the line under the cursor.

    `ansi` are variables of one in the terminal's own colours, over those that follow from the rest.
    """
    background, panel, boost, line = grounds
    return Theme(
        name=name,
        primary=roles["focus"],
        secondary=roles["selected"],
        accent=roles["warning"],
        success=roles["good"],
        warning=roles["warning"],
        error=roles["alarm"],
        foreground=roles["text"],
        background=background,
        surface=background,
        panel=panel,
        boost=boost,
        dark=dark,
        ansi=bool(ansi),
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
            "input-selection-background": roles["focus"],
            "input-selection-foreground": background,
            "line": line,
            "quiet": roles["quiet"],
            "plot": roles["data"],
            **{role: roles[role] for role in ROLES},
            **ansi,
        },
    )


DARK = _theme(
    "silo-dark",
    dark=True,
    grounds=("#12161b", "#1b2129", "#232a33", "#243448"),
    roles={
        "text": "#c5ced8", "quiet": "#8d9aa8", "focus": "#6cabf7", "good": "#6bb36f", "data": "#6cb2eb",
        "alarm": "#f98377", "warning": "#e0a458", "pending": "#c3a6f2", "dead": "#c9a3a3", "selected": "#6bc1c9",
    },
    lines="#3a4552",
)  # fmt: skip
LIGHT = _theme(
    "silo-light",
    dark=False,
    grounds=("#fbfbfa", "#eeeeec", "#e6e6e3", "#d6e4f5"),
    roles={
        "text": "#24292f", "quiet": "#56606b", "focus": "#1d559c", "good": "#1f6426", "data": "#2059a3",
        "alarm": "#a81d12", "warning": "#7d4d00", "pending": "#6a3fa8", "dead": "#74484f", "selected": "#0f636b",
    },
    lines="#b9bfc6",
)  # fmt: skip
CONTRAST = _theme(
    "silo-contrast",
    dark=True,
    grounds=("#000000", "#141414", "#262626", "#003a70"),
    roles={
        "text": "#ffffff", "quiet": "#d6d6d6", "focus": "#8cc8ff", "good": "#7dff7d", "data": "#8cd5ff",
        "alarm": "#ffb3ab", "warning": "#ffd75f", "pending": "#e0c8ff", "dead": "#d8cfc0", "selected": "#7df0ff",
    },
    lines="#ffffff",
)  # fmt: skip
# The terminal's own sixteen: neither bright black, unseen in Solarized, nor dark blue, unseen on black. What can't be
# told by a colour is told by `:ansi` rules in silo.tcss: quiet is dim, the line under the cursor reversed.
SIXTEEN = _theme(
    "silo-16",
    dark=True,
    grounds=(_OWN, _OWN, _OWN, _OWN),
    roles={
        "text": _OWN, "quiet": _OWN, "focus": "ansi_bright_blue", "good": "ansi_green", "data": "ansi_bright_cyan",
        "alarm": "ansi_bright_red", "warning": "ansi_yellow", "pending": "ansi_bright_magenta", "dead": "ansi_red",
        "selected": "ansi_cyan",
    },
    lines=_OWN,
    ansi={
        "ansi-background": _OWN, "ansi-foreground": _OWN, "block-cursor-text-style": "reverse",
        "input-cursor-background": _OWN, "input-cursor-foreground": _OWN, "input-cursor-text-style": "reverse",
        "input-selection-background": "ansi_bright_blue", "input-selection-foreground": "ansi_black",
        "scrollbar-hover": "ansi_bright_blue",
    },
)  # fmt: skip
THEMES = (DARK, LIGHT, CONTRAST, SIXTEEN)
# themes of Textual's own know nothing of ours
FALLBACK = {name: SIXTEEN.variables[name] for name in ("line", "quiet", "plot", *ROLES)}


def color(variables: Mapping[str, str], name: str) -> str:
    """Return a colour of the theme as Rich writes it (`ansi_red` is `red` there)."""
    return variables.get(name, "").removeprefix("ansi_").replace("default", "") or "none"


def bold(variables: Mapping[str, str], name: str) -> str:
    """Return the style of a word that is to be seen; plain for no name."""
    return f"bold {color(variables, name)}" if name else ""


def theme_name(word: str) -> str:
    """Return what Textual calls a theme: `silo-dark` for `dark`."""
    return f"silo-{word}"


def chosen(word: str, available: Container[str]) -> str:
    """Return the theme to begin with: `TEXTUAL_THEME` if it is set and there, else that of the settings."""
    wanted = os.environ.get("TEXTUAL_THEME", "")
    return wanted if wanted in available else theme_name(word)
