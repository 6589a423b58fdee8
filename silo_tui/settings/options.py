"""What can be set, each one entry: its words or range, its default, what it means. File, screen and help read this."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import msgspec

from silo_tui.keymap import DEFAULT
from silo_tui.model.drawing.dots import STYLES
from silo_tui.model.table.columns import SETTINGS
from silo_tui.settings.themes import THEMES


class Option(msgspec.Struct, frozen=True):
    """One setting: `words` it may be, or the `low` to `high` of a number; `several` take a list of words."""

    name: str
    meaning: str
    words: tuple[str, ...] = ()
    meanings: tuple[str, ...] = ()  # of the words, where they don't say it
    samples: tuple[str, ...] = ()  # of the words: how they look
    low: float = 0.0
    high: float = 0.0
    several: bool = False

    @property
    def range_text(self) -> str:
        """What it may be, in a few words."""
        return ", ".join(self.words) if self.words else f"{self.low:g} to {self.high:g}"


OPTIONS = (
    Option("theme", "colours", THEMES, ("", "", "high contrast", "16 colours")),
    Option(
        "dots", "what curves are drawn with", ("auto", *STYLES),
        ("blocks on the Linux console, else braille", *(style.hint for style in STYLES.values())),
        ("", *(style.sample for style in STYLES.values())),
    ),
    Option("mouse", "take the mouse", ("auto", "on", "off"), ("not over SSH: it prevents selecting text", "", "")),
    Option("rate", "refreshes a second", low=0.5, high=10.0),
    Option(
        "view", "what was on the screen is there again", ("offered", "always", "off"),
        ("a line tells of it", "as it was left, whenever one opens", "nothing is kept"),
    ),
    Option(
        "keymap", "which keys there are", ("two-layer", "classic"),
        ("the same few keys on every screen, the rest in menus", "a key for each command, \\ for menus"),
    ),
    Option("columns", "columns of the table, none: all", SETTINGS, several=True),
)  # fmt: skip
OPTION = {option.name: option for option in OPTIONS}


@dataclass(frozen=True)
class Settings:
    """One field per option, and `keys`: of commands by id, as Textual writes them (`ctrl+f,slash`)."""

    theme: str = "dark"
    dots: str = "auto"
    mouse: str = "auto"
    rate: float = 5.0
    view: str = "offered"
    columns: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)
    keymap: str = DEFAULT
    named: frozenset[str] = field(default=frozenset(), compare=False)  # by the file


def changed(old: Settings, new: Settings) -> dict[str, Any]:
    """Return the options that differ, by name; of the keys see `reading`."""
    return {
        option.name: getattr(new, option.name)
        for option in OPTIONS
        if getattr(old, option.name) != getattr(new, option.name)
    }


def typed(value: object) -> str:
    """Return a value as the file has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
