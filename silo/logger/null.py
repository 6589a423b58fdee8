"""A logger that does nothing, with the interface of `Logger`: code that logs need not care whether anybody does.

It remembers names and shapes of what was added, so that what asks for them finds them.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn, SupportsIndex

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.core.arguments import path as file_path
from silo.core.calls import told_class
from silo.core.elements import (
    DEFAULT_OPTIONS,
    NO_EXTRAS,
    Conditions,
    Edit,
    ElementInfo,
    Entry,
    FileType,
    LoggerOptions,
    SignalLimits,
    State,
    Storage,
    Threads,
    TriggerOptions,
    join_name,
)
from silo.core.kinds import index_suffixes, kind_by_shape
from silo.core.recording import Recording
from silo.errors import ElementError
from silo.logger.calls.keywords import (
    AnyAction,
    AnyBuffer,
    AnyStorage,
    AnyThreads,
    ControlWord,
    ElementKeywords,
    FileTypes,
    GroupRoleWord,
    Labels,
    Number,
    OptionKeywords,
    Switch,
    UnsavedWord,
)
from silo.logger.calls.options import array_layout
from silo.logger.calls.other_names import HidesOtherNames, listed, not_deleted, not_set, with_other_names
from silo.logger.elements import Elements, LoggedElement, SavedFiles
from silo.logger.new_values import NewValues

if TYPE_CHECKING:
    from typing_extensions import Unpack  # known to type checkers without being installed


class _NoFiles(SavedFiles):
    """What `NullLogger.save` returns."""

    path = os.devnull
    size_bytes = 0


class NullServing:
    """What `NullLogger.serve` returns: nothing listens."""

    alive = False
    foxglove_port = None

    def close(self) -> None:
        """Do nothing."""

    def __enter__(self) -> "NullServing":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing."""


@with_other_names
@told_class("log", make="silo.NullLogger", leave=("collect",))
class NullLogger(metaclass=HidesOtherNames):
    """Takes every call of `Logger` and logs nothing. `array` returns ordinary zeros, so that the program works on."""

    is_running = False
    is_closed = False
    has_unsaved = False
    ticks = 0
    lost = 0
    ignored = 0
    revision = 0
    stop_reason = ""
    saved_before_start = ""
    segment_path = ""
    state = State.STOPPED

    def __init__(
        self,
        name: str = "silo",
        *,
        frequency: float = 100.0,
        max_time: float = 10.0,
        script: str | os.PathLike[str] = "logger.yaml",
        prefix: str = "/log",
        clock: Callable[[], int | float] | None = None,
        folder: str | os.PathLike[str] = ".",
        storage: AnyStorage = Storage.MEMORY,
        size_tiers: int = 3,
        memory_limit_mb: int = 1024,
        checked: bool = False,
        threads: AnyThreads = Threads.SINGLE,
    ) -> None:
        self.options = LoggerOptions(name=name, frequency_hz=frequency, max_time_s=max_time, prefix=prefix)
        self.elements = Elements((), prefix)
        self.source_failures: dict[str, int] = {}
        self.extras = NO_EXTRAS

    def add(
        self,
        source: object,
        name: str | None = None,
        group: str = "",
        unit: str = "-",
        divider: Number = DEFAULT_OPTIONS.divider,
        action: AnyAction = DEFAULT_OPTIONS.action,
        buffer_size: Number | None = None,
        buffer_type: AnyBuffer = DEFAULT_OPTIONS.buffer_type,
        *,
        attr: str | None = None,
        enabled: Switch = DEFAULT_OPTIONS.enabled,
        kind: str = "",
        labels: Labels | None = None,
        description: str = "",
        string_bytes: SupportsIndex | None = None,
        limits: Sequence[float | None] | None = None,
    ) -> None:
        """Log nothing; the name is in the table from now on."""
        known = name or (str(attr).rsplit(".", 1)[-1] if attr else getattr(source, "__name__", ""))
        self._remember(str(known), str(group), tuple(getattr(source, "shape", ())) if attr is None else (), unit)

    def _remember(self, name: str, group: str, shape: tuple[int, ...], unit: str) -> None:
        full = join_name(self.options.prefix, group, name)
        kind = kind_by_shape(shape).name
        suffixes = index_suffixes(shape) or [""]
        entries = tuple(Entry(suffix, "<f8") for suffix in suffixes)
        info = ElementInfo(full, str(unit), kind, shape, entries, DEFAULT_OPTIONS)
        self.elements = Elements([*(one for one in self.elements if one.name != full), info], self.options.prefix)

    def _known(self, name: str) -> ElementInfo | None:
        found = self.elements.known.find(name, namespaces=False)
        return list(self.elements)[found[0][0]] if len(found) == 1 else None

    def array(
        self,
        name: str,
        shape: SupportsIndex | Sequence[SupportsIndex] = (),
        dtype: DTypeLike = float,
        **options: "Unpack[ElementKeywords]",
    ) -> NDArray[Any]:
        """Return zeros of this shape and type. Raises like `Logger.array`."""
        made = np.zeros(*array_layout(shape, dtype))
        self.add(made, name, **options)
        return made

    def derive(self, name: str, expression: str, *, group: str = "", unit: str = "") -> None:
        """Derive nothing."""

    def remove_derived(self, name: str) -> None:
        """Forget nothing."""

    def limit(
        self,
        name: str,
        bounds: Sequence[float | None],
        *,
        persistence: int = 1,
        hysteresis: float = 0.0,
        stale: float | str = 0.0,
        when: str = "",
    ) -> None:
        """Limit nothing."""

    def trigger(
        self,
        name: str,
        when: str,
        *,
        pre: float | str = 0.0,
        post: float | str = 0.0,
        edge: str = "rising",
        rearm: str = "",
        persist: float | str = 0.0,
        holdoff: float | str = 0.0,
        mode: str = "normal",
        save: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
        keep: int = 0,
    ) -> None:
        """Capture nothing."""

    def set_trigger(self, one: TriggerOptions) -> None:
        """Capture nothing."""

    def remove_trigger(self, name: str) -> None:
        """Do nothing."""

    def set_limits(self, one: SignalLimits) -> None:
        """Limit nothing."""

    def remove_limits(self, name: str) -> None:
        """Do nothing."""

    def apply_extras(self, extras: Conditions, edits: Sequence[Edit] = ()) -> None:
        """Do nothing."""

    def update(self, *, read_script: bool = True) -> None:
        """Do nothing."""

    def collect(self) -> None:
        """Do nothing."""

    def mark(self, text: str = "mark", *more: object) -> None:
        """Mark nothing."""

    def start(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Do nothing."""

    def stop(self) -> None:
        """Do nothing."""

    def restart(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Do nothing."""

    def set(self, name: str = "/", **options: "Unpack[OptionKeywords]") -> int:
        """Change nothing; 0 elements."""
        return 0

    def remove(self, name: str) -> int:
        """Forget an element or a whole namespace; how many there were."""
        gone = {place for place, _ in self.elements.known.find(name)}
        kept = (one for place, one in enumerate(self.elements) if place not in gone)
        self.elements = Elements(kept, self.options.prefix)
        return len(gone)

    def enable(self, name: str = "/") -> int:
        """Change nothing; 0 elements."""
        return 0

    def disable(self, name: str = "/") -> int:
        """Change nothing; 0 elements."""
        return 0

    def apply(self, edits: Sequence[Edit]) -> int:
        """Change nothing; 0 elements."""
        return 0

    def load_script(self, path: str | os.PathLike[str] | None = None) -> list[str]:
        """Read nothing; no unknown names."""
        return []

    def save_script(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Write nothing; the path that would have been written."""
        return file_path("path", path) if path else Path(self.options.script)

    def snapshot(self) -> Recording:
        """Return an empty recording."""
        return Recording(self.options.name, np.empty(0, np.int64), 0, ())

    @property
    def name(self) -> str:
        """The logger's name."""
        return self.options.name

    def element(self, name: str) -> LoggedElement:
        """Return an element without options and values of its own. Raises like `Logger.element`."""
        info = self._known(name)
        if info is None:
            hint = self.elements.known.hint(name, f"the table has {len(self)} elements")
            raise ElementError(f"no element '{name}'{hint}")
        return LoggedElement(info)

    def __getitem__(self, name: str) -> LoggedElement:
        return self.element(name)

    def __setitem__(self, name: str, value: object) -> NoReturn:
        not_set(name)

    def __delitem__(self, name: str) -> NoReturn:
        not_deleted(name)

    def __dir__(self) -> list[str]:
        return listed(super().__dir__(), type(self))

    def __len__(self) -> int:
        return len(self.elements)

    def __bool__(self) -> bool:
        return True  # as any logger

    def __iter__(self) -> Iterator[str]:
        return iter([info.name for info in self.elements])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._known(name) is not None

    def __repr__(self) -> str:
        return f"<NullLogger {self.name}: logs nothing>"

    def _repr_html_(self) -> str:
        return "<p><b>NullLogger</b>: logs nothing; silo.init() or silo.Logger() make one that does</p>"

    def read_new_values(self, name: str) -> NewValues:
        """Return no values, in the shape of the element."""
        info = self._known(name)
        return NewValues(np.empty(0, np.int64), np.empty((0, *(info.shape if info is not None else ()))), 0)

    def save(
        self,
        types: FileTypes = (FileType.SILO,),
        name: str | None = None,
        folder: str | os.PathLike[str] | None = None,
    ) -> SavedFiles:
        """Write nothing; no files, and `os.devnull` as the path of one."""
        return _NoFiles()

    def record(
        self,
        patterns: Iterable[str] = (),
        *,
        to: str | os.PathLike[str] = "recordings",
        split: str = "1GB",
        keep: str = "",
        name: str = "",
    ) -> str:
        """Record nothing."""
        return name

    def stop_recording(self, name: str = "") -> str:
        """Do nothing."""
        return ""

    def serve(
        self,
        *,
        group: str | None = None,
        config: str | os.PathLike[str] | None = None,
        foxglove: int | None = None,
        group_role: GroupRoleWord = "operator",
        control: ControlWord = "any",
    ) -> NullServing:
        """Start nothing: nobody listens."""
        return NullServing()

    def close(self, *, discard: bool = False) -> None:
        """Do nothing."""

    cleanup = close

    def abandon(self) -> None:
        """Do nothing."""

    def __enter__(self) -> "NullLogger":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing."""
