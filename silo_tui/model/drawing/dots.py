"""Grids of dots as characters, two columns and four rows of dots per cell, in one style for all plots.

The settings choose it. Which there are is a line of the table `STYLES` each: the settings, their picture and all plots
know it. A cell of the terminal is a pattern of 8 bits, of which the lowest is the dot on the left of the top row, the
next the one beside it; a style has a character for each of the 256 patterns.
"""

import os
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

# not U+2800: some fonts draw its dots, and a space is one byte instead of three
BLANK = " "

# of the 256 patterns, by octants from left to right and top to bottom, those that had a character before Unicode 16
_OLDER = {
    (): BLANK, (1, 2, 3, 4, 5, 6, 7, 8): "█", (1, 2, 3, 4): "▀", (5, 6, 7, 8): "▄", (1, 3, 5, 7): "▌",
    (2, 4, 6, 8): "▐", (1, 3): "▘", (2, 4): "▝", (5, 7): "▖", (6, 8): "▗", (1, 3, 6, 8): "▚", (2, 4, 5, 7): "▞",
    (1, 2, 3, 4, 5, 7): "▛", (1, 2, 3, 4, 6, 8): "▜", (1, 3, 5, 6, 7, 8): "▙", (2, 4, 5, 6, 7, 8): "▟",
    (7, 8): "▂", (3, 4, 5, 6, 7, 8): "▆", (1, 2): "\U0001fb82", (1, 2, 3, 4, 5, 6): "\U0001fb85",
    (3, 5): "\U0001fbe6", (4, 6): "\U0001fbe7", (8,): "\U0001cea0", (7,): "\U0001cea3", (1,): "\U0001cea8",
    (2,): "\U0001ceab",
}  # fmt: skip
_FIRST_OCTANT = 0x1CD00


def _braille() -> list[int]:
    # its dots are numbered down the columns, the lowest row last
    bits = (0x01, 0x08, 0x02, 0x10, 0x04, 0x20, 0x40, 0x80)
    drawn = (sum(bit for place, bit in enumerate(bits) if pattern >> place & 1) for pattern in range(1, 256))
    return [ord(BLANK), *(0x2800 + dots for dots in drawn)]


def _octants() -> list[int]:
    """Return them all: the new ones stand in the order of their patterns, without those that were there before."""
    older = {sum(1 << place - 1 for place in places): ord(char) for places, char in _OLDER.items()}
    new = iter(range(_FIRST_OCTANT, _FIRST_OCTANT + 256))
    return [older[pattern] if pattern in older else next(new) for pattern in range(256)]


def _blocks() -> list[int]:
    """Return a half of a cell where any of its dots is lit."""
    return [ord(" ▀▄█"[(pattern & 0x0F > 0) + 2 * (pattern & 0xF0 > 0)]) for pattern in range(256)]


class PlotStyle(msgspec.Struct, frozen=True):
    """One way to draw: the code points of the 256 patterns, how it looks in the settings, and where it is for."""

    code_points: Sequence[int]
    sample: str
    hint: str = ""


STYLES: Mapping[str, PlotStyle] = {
    "braille": PlotStyle(_braille(), "⡠⠊⠉⠢⡀⢀⠔"),
    "octants": PlotStyle(_octants(), "\U0001cd51\U0001cd01\U0001fb82\U0001cd1c\U0001cea3\U0001cea0\U0001cd10",
                         "where the font has them"),
    "blocks": PlotStyle(_blocks(), "▄▀▀█▄▄█"),
}  # fmt: skip


Dots = NDArray[np.bool_]
Cells = NDArray[np.uint32]

_TABLES = {name: np.array(style.code_points, np.uint32) for name, style in STYLES.items()}
_WEIGHTS = np.array([[1, 2], [4, 8], [16, 32], [64, 128]], np.uint32)
_OF_TERMINAL = "blocks" if os.environ.get("TERM") == "linux" else "braille"
_style = _OF_TERMINAL


def choose(name: str) -> None:
    """Draw all plots in this style from now on; "auto" leaves it to the terminal. Raises ValueError for an unknown."""
    global _style  # noqa: PLW0603 - one terminal, one font, one choice
    if name not in ("auto", *STYLES):
        raise ValueError(f"dots: {name!r} is unknown; one of auto, {', '.join(STYLES)}")
    _style = _OF_TERMINAL if name == "auto" else name


def cells(dots: Dots) -> Cells:
    """Return code points, shape `(height, width)`, of dots, shape `(4 * height, 2 * width)`, row 0 on top."""
    rows, columns = dots.shape
    grid = dots.reshape(rows // 4, 4, columns // 2, 2)
    patterns = (grid * _WEIGHTS[None, :, None, :]).sum(axis=(1, 3))
    found: Cells = _TABLES[_style][patterns]
    return found


def lines_of(code_points: Cells) -> list[str]:
    """Return the lines of a grid of code points."""
    return [line.tobytes().decode("utf-32-le") for line in code_points.astype("<u4")]
