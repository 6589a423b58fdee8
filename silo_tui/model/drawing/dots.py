"""Grids of dots as characters, two columns and four rows of dots per cell, in one style for all plots.

The settings choose it; which there are stands in `plot_styles`.
"""

import os

import numpy as np
from numpy.typing import NDArray

from silo_tui.model.drawing.plot_styles import STYLES

Dots = NDArray[np.bool_]
Cells = NDArray[np.uint32]

_TABLES = {name: np.array(style.code_points, np.uint32) for name, style in STYLES.items()}
_WEIGHTS = np.array([[1, 2], [4, 8], [16, 32], [64, 128]], np.uint32)
_OF_TERMINAL = "blocks" if os.environ.get("TERM") == "linux" else "braille"
_style = _OF_TERMINAL


def style() -> str:
    """Return the style that plots are drawn in."""
    return _style


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
