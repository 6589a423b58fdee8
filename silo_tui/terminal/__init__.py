"""What depends on the terminal that we run in: what it shows, how much it takes, when it goes away.

The app names `CellDriver` and asks the functions here; widgets ask `pace_of`. The rest is inside: `driver` puts
together `parser` (what Textual draws), `cells` and `styles` (what must be sent), `answers` and `pacing` (how much may
be on its way) and `thinness` (what is left out on a thin link).
"""

import os
from typing import Any

from textual.app import App
from textual.driver import Driver

from silo_tui.terminal.driver import CellDriver
from silo_tui.terminal.pacing import link_words
from silo_tui.terminal.signals import end_on_signals, has_few_colors, mouse_wanted, over_ssh
from silo_tui.terminal.thinness import Pace, head_words

__all__ = [
    "CellDriver", "Pace", "backed_up", "driver_class", "end_on_signals", "has_few_colors", "may_paint", "mouse_wanted",
    "over_ssh", "pace_of", "repaint", "take_mouse", "thin_head", "thin_words",
]  # fmt: skip


def _driver_of(app: App[Any]) -> CellDriver | None:
    driver = app._driver  # private to Textual; this is the only place that looks at it
    return driver if isinstance(driver, CellDriver) else None


def driver_class() -> type[Driver] | None:
    """Return ours, or None where somebody else's was asked for."""
    return None if in_browser() else CellDriver


def in_browser() -> bool:
    """Return whether this is shown elsewhere than in a terminal: a page in a browser asks so for its driver."""
    return "TEXTUAL_DRIVER" in os.environ


def take_mouse(app: App[Any], *, wanted: bool) -> None:
    """Take the mouse from the terminal, or leave it to it, while the app runs."""
    driver = _driver_of(app)
    if driver is not None:
        driver.take_mouse(wanted=wanted)


def backed_up(app: App[Any]) -> bool:
    """Return whether the terminal lags: then live paints wait."""
    driver = _driver_of(app)
    return driver is not None and driver.behind


def repaint(app: App[Any]) -> None:
    """Send the whole screen again."""
    if (driver := _driver_of(app)) is not None:
        driver.repaint()


def pace_of(app: App[Any]) -> Pace:
    """Return how often and how exactly values are painted now."""
    driver = _driver_of(app)
    return driver.thinness.pace if driver is not None else Pace()


def may_paint(app: App[Any], wished_hz: float) -> bool:
    """Return whether new values are to be painted now. Asked `wished_hz` times a second; it judges the link by that."""
    driver = _driver_of(app)
    return driver is None or driver.may_paint(wished_hz)


def thin_head(app: App[Any], room: int) -> str:
    """Return what the head says of a thin link, or of a computer that does not paint as often as is wished.

    `THIN 1.2 of 5 Hz 64 kbit/s 210 ms`, as much of it as has room, `DRAWN 1.2 of 5 Hz` where it is not known to be the
    link; empty where all is shown.
    """
    driver = _driver_of(app)
    return head_words(driver.thinness, driver.painted, link_words(driver.pacer), room) if driver is not None else ""


def thin_words(app: App[Any], wished_hz: float) -> str:
    """Return what is left out on a thin link; empty where all is shown."""
    driver = _driver_of(app)
    return driver.thinness.words(wished_hz) if driver is not None else ""
