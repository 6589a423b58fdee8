"""One element of a logger, as a program looks at it: options, newest value, samples held."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from silo.collecting.keeping import kept_rows
from silo.collecting.segment_reader import SegmentReader
from silo.logger.new_values import sample_values
from silo.model import ElementInfo, ElementOptions


@dataclass(frozen=True, eq=False)
class LoggedElement:
    """What `log["joints/q"]` returns: a row of the table, and what the present run holds of it at this moment.

    Attributes:
        info: the row of the table.
        newest: the last logged value, of the element's shape; None before the first sample, and for an element that
            isn't logged in this run.
        time_ns: its time stamp, ns; None where `newest` is.
        held: how many samples are in its buffer.
        lost: how many could not be kept.
    """

    info: ElementInfo
    newest: Any = None
    time_ns: int | None = None
    held: int = 0
    lost: int = 0

    @property
    def name(self) -> str:
        """The full name."""
        return self.info.name

    @property
    def unit(self) -> str:
        """The unit, `-` for none."""
        return self.info.unit

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of one sample."""
        return self.info.shape

    @property
    def options(self) -> ElementOptions:
        """How it is logged."""
        return self.info.options

    def __repr__(self) -> str:
        unit = "" if self.unit == "-" else f" [{self.unit}]"
        return f"<Element {self.name}{unit} {options_text(self.options)}, {self.held} held, newest {newest_text(self)}>"


def options_text(options: ElementOptions) -> str:
    """Options in a few words: `every 2nd tick, save, looping 100`."""
    every = "" if options.divider == 1 else f"divider {options.divider}, "
    off = "" if options.enabled else "off, "
    return f"{off}{every}{options.action.name.lower()}, {options.buffer_type.name.lower()} {options.buffer_size}"


def newest_text(element: LoggedElement) -> str:
    """The newest value on one line."""
    if element.time_ns is None:
        return "none"
    return np.array2string(np.asarray(element.newest), precision=6, threshold=8, separator=", ").replace("\n", "")


def look_at(info: ElementInfo, reader: SegmentReader | None) -> LoggedElement:
    """Return what a run holds of an element; `reader` is None before the first."""
    if reader is None:
        return LoggedElement(info)
    schema = next((one for one in reader.schema.elements if one.info.name == info.name), None)
    if schema is None:
        return LoggedElement(info)
    head = reader.head(schema.ring)
    begin, end = kept_rows(schema.info.options, 0, head)
    lost = reader.ring_lost(schema.ring)
    rows = reader.rows(schema.ring, end - 1, 1) if end > begin else None
    if rows is None or not len(rows):
        return LoggedElement(info, held=end - begin, lost=lost)
    return LoggedElement(info, sample_values(schema, rows)[-1], int(rows.time_ns[-1]), end - begin, lost)
