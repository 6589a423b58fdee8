"""A logger that does nothing, with the interface of `Logger`: code that logs need not care whether anybody does."""

import enum
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.arguments import path as file_path
from silo.logger.new_values import NewValues
from silo.logger.options import array_layout
from silo.model import (
    DEFAULT_OPTIONS,
    Action,
    BufferType,
    Edit,
    ElementInfo,
    FileType,
    LoggerOptions,
    SavedFile,
    State,
    Storage,
    Threads,
)
from silo.recording import Recording


class NullServing:
    """What `NullLogger.serve` returns: nothing listens."""

    alive = False

    def close(self) -> None:
        """Do nothing."""

    def __enter__(self) -> "NullServing":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing."""


class NullLogger:
    """Takes every call of `Logger` and logs nothing. `array` returns ordinary zeros, so that the program works on."""

    is_running = False
    is_closed = False
    has_unsaved = False
    ticks = 0
    lost = 0
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
        storage: str | Storage = Storage.MEMORY,
        size_tiers: int = 3,
        memory_limit_mb: int = 1024,
        checked: bool = False,
        threads: str | Threads = Threads.SINGLE,
    ) -> None:
        self.options = LoggerOptions(name=name, frequency_hz=frequency, max_time_s=max_time, prefix=prefix)
        self.elements: list[ElementInfo] = []
        self.source_failures: dict[str, int] = {}

    def add(
        self,
        source: object,
        name: str | None = None,
        *,
        attr: str | None = None,
        group: str = "",
        unit: str = "-",
        divider: int | str = DEFAULT_OPTIONS.divider,
        action: Action | str = DEFAULT_OPTIONS.action,
        buffer_type: BufferType | str = DEFAULT_OPTIONS.buffer_type,
        buffer_size: int | str | None = None,
        enabled: bool | str = DEFAULT_OPTIONS.enabled,
        kind: str = "",
        labels: type[enum.Enum] | Mapping[int, str] | None = None,
        description: str = "",
        string_bytes: int | None = None,
    ) -> None:
        """Register nothing."""

    def array(
        self, name: str, shape: int | tuple[int, ...] = (), dtype: DTypeLike = float, **options: Any
    ) -> NDArray[Any]:
        """Return zeros of this shape and type. Raises like `Logger.array`."""
        return np.zeros(*array_layout(shape, dtype))

    def update(self, *, read_script: bool = True) -> None:
        """Do nothing."""

    def collect(self) -> None:
        """Do nothing."""

    def start(self, *, unsaved: str = "clear") -> None:
        """Do nothing."""

    def stop(self) -> None:
        """Do nothing."""

    def restart(self, *, unsaved: str = "clear") -> None:
        """Do nothing."""

    def set(self, name: str = "/", **options: Any) -> int:
        """Change nothing; 0 elements."""
        return 0

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

    def read_new_values(self, name: str) -> NewValues:
        """Return no values."""
        return NewValues(np.empty(0, np.int64), np.empty(0), 0)

    def save(
        self,
        types: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
        name: str | None = None,
        folder: str | os.PathLike[str] | None = None,
    ) -> list[SavedFile]:
        """Write nothing; no files."""
        return []

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

    def serve(self, *, group: str | None = None, config: str | os.PathLike[str] | None = None) -> NullServing:
        """Start nothing: nobody listens."""
        return NullServing()

    def close(self) -> None:
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
