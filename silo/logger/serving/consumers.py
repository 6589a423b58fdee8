"""Who still has to read a run that its program is done with: what the helper process records, and judges."""

import contextlib
from typing import Protocol

from silo.core.elements import Conditions, LoggerOptions
from silo.core.runtime import list_held
from silo.errors import SegmentError
from silo.loop.run import Run
from silo.segment.held_runs import is_due, recorders_path


class HelperSide(Protocol):
    """What serves a logger, seen from here."""

    alive: bool
    is_up: bool


def is_wanted(run: Run, server: HelperSide | None, extras: Conditions) -> bool:
    """Whether a run is to be held that ends now.

    While the helper process is down nobody can tell: its successor looks at it, and lets go of what nobody needs.
    """
    if server is None:
        return False
    if is_due(run.segment.schema):
        return True
    return server.alive and (not server.is_up or has_conditions(extras) or has_conditions(run.segment.schema.extras))


def has_conditions(extras: Conditions) -> bool:
    """Whether something is judged."""
    return bool(extras.limits or extras.triggers)


def has_left(options: LoggerOptions) -> bool:
    """Whether recorders, or runs that are held, wait for the next helper process of a logger."""
    with contextlib.suppress(SegmentError):  # no runtime folder: then nothing is left in it either
        if recorders_path(options.name, options.id).exists():
            return True
        return any(path.name.lstrip(".").startswith(f"{options.name}.") for path in list_held())
    return False
