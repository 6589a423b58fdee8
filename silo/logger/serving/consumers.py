"""Who still has to read a run that its program is done with: what the helper process records, and judges."""

import contextlib

from silo.core.elements import LoggerOptions
from silo.core.runtime import list_held
from silo.errors import SegmentError
from silo.segment.held_runs import recorders_path


def has_left(options: LoggerOptions) -> bool:
    """Whether recorders, or runs that are held, wait for the next helper process of a logger."""
    with contextlib.suppress(SegmentError):  # no runtime folder: then nothing is left in it either
        if recorders_path(options.name, options.id).exists():
            return True
        return any(path.name.lstrip(".").startswith(f"{options.name}.") for path in list_held())
    return False
