"""One element of a logger, as a program looks at it: options, newest value, samples held."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn, SupportsIndex, overload

import numpy as np

from silo.core.calls import no_attribute
from silo.core.elements import ElementInfo, ElementOptions, SavedFile
from silo.core.names import Names
from silo.core.printing import MOST_ROWS, html_table
from silo.errors import ArgumentError, UnknownNameError
from silo.logger.new_values import sample_values
from silo.segment.reader import SegmentReader
from silo.segment.retention import kept_rows

_ALL = "log[{!r}].newest is the newest value, silo.Log(log.snapshot())[{!r}].values are all"
_NEWEST = "it is .newest"
_OPTION = "it is .options.{}; log.set({!r}, ...) changes it"
_INFO = "it is .info.{}"


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

    if not TYPE_CHECKING:  # type checkers find it themselves

        def __getattr__(self, name: str) -> NoReturn:
            mine = self.info.name if "info" in self.__dict__ else ""
            others = dict.fromkeys(("values", "data", "samples", "history", "array"), _ALL.format(mine, mine))
            others |= dict.fromkeys(("value", "latest", "last", "current", "now"), _NEWEST)
            others |= dict.fromkeys(("time", "times", "t", "stamp"), "it is .time_ns")
            others |= dict.fromkeys(("count", "samples_held", "size"), "it is .held")
            options = ("divider", "action", "buffer_type", "buffer_size", "enabled")
            others |= {one: _OPTION.format(one, mine) for one in options}
            others |= {one: _INFO.format(one) for one in ("kind", "dtype", "description", "entries")}
            no_attribute("an element", name, type(self), others)

    def __repr__(self) -> str:
        unit = "" if self.unit == "-" else f" [{self.unit}]"
        return f"<Element {self.name}{unit} {options_text(self.options)}, {self.held} held, newest {newest_text(self)}>"


class Elements(list[ElementInfo]):
    """The rows of the element table, by number or by name: `log.elements["joints/q"]`."""

    def __init__(self, infos: Iterable[ElementInfo] = (), prefix: str = "") -> None:
        super().__init__(infos)
        self._prefix = prefix

    @property
    def known(self) -> Names:
        """What the names of the rows mean."""
        return Names((info.name for info in self), self._prefix)

    @overload
    def __getitem__(self, key: SupportsIndex | str) -> ElementInfo: ...
    @overload
    def __getitem__(self, key: slice) -> list[ElementInfo]: ...
    def __getitem__(self, key: SupportsIndex | slice | str) -> ElementInfo | list[ElementInfo]:
        if not isinstance(key, str):
            return super().__getitem__(key)
        found = self.known.find(key, namespaces=False)
        if len(found) == 1:
            return super().__getitem__(found[0][0])
        if found:
            raise UnknownNameError(self.known.several(key, found))
        raise UnknownNameError(f"no element '{key}'{self.known.hint(key, f'list(log) has all {len(self)}')}")


class SavedFiles(list[SavedFile]):
    """The files of one save, in the order of their types; of a single one, `path` and `size_bytes` are its own."""

    @property
    def path(self) -> str:
        """Where the file is. Raises `ArgumentError` where it is not one."""
        return self._only("path").path

    @property
    def size_bytes(self) -> int:
        """How much it takes. Raises `ArgumentError` where it is not one file."""
        return self._only("size_bytes").size_bytes

    def _only(self, what: str) -> SavedFile:
        if len(self) != 1:
            raise ArgumentError(f"{len(self)} files were saved: [file.{what} for file in saved] has it of each")
        return self[0]


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


def as_html(title: str, names: Sequence[str], element: Callable[[str], LoggedElement]) -> str:
    """The first elements as a table, for notebooks."""
    rows = [
        (one.name, one.unit, "on" if one.options.enabled else "off", one.options.divider,
         one.options.action.name.lower(), f"{one.options.buffer_type.name.lower()} {one.options.buffer_size}",
         one.held, newest_text(one))
        for one in (element(name) for name in names[: MOST_ROWS + 1])
    ]  # fmt: skip
    heads = ("element", "unit", "log", "divider", "action", "buffer", "held", "newest")
    more = f"{len(names)} elements in all" if len(names) > MOST_ROWS else ""
    return html_table(title, heads, rows[:MOST_ROWS], more)
