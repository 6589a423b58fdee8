"""A logger that does nothing, with the interface of `Logger`: code that logs need not care whether anybody does.

Its methods take the arguments of `Logger`'s, from its signatures; their values are looked at where a message is due
alone. It remembers names and shapes of what was added, so that what asks for them finds them.
"""

import inspect
import os
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.core.arguments import path as file_path
from silo.core.calls import call_problem, of
from silo.core.conditions import NO_CONDITIONS
from silo.core.elements import DEFAULT_OPTIONS, ElementInfo, Entry, LoggerOptions, join_name
from silo.core.episodes.block import EpisodeBlock
from silo.core.kinds import index_suffixes, kind_by_shape
from silo.core.quantities.writing import many
from silo.core.recording import Recording
from silo.errors import ArgumentError, ElementError
from silo.logger.arguments.options import array_layout
from silo.logger.arguments.other_names import LoggerNames
from silo.logger.life_cycle import LifeCycle
from silo.logger.logger import Logger
from silo.logger.results import Elements, LoggedElement, NewValues, SavedFiles
from silo.logger.tunables import Tunables
from silo.loop.sources import VariableSet
from silo.parameters.parameters import Parameters
from silo.rpc.leases import Closing

P = ParamSpec("P")
R = TypeVar("R")

_NOTHING: dict[object, Callable[[], object]] = {None: type(None), int: int, str: str, list[str]: list}


def _like(
    method: Callable[Concatenate[Any, P], object],
) -> Callable[[Callable[..., R]], Callable[Concatenate[Any, P], R]]:
    """Let a method be called as one of `Logger`; its body is given all arguments by their names, defaults as well."""
    signature = inspect.signature(method)
    label = "silo.NullLogger" if method.__name__ == "__init__" else f"log.{method.__name__}"

    def wrapped(body: Callable[..., R]) -> Callable[Concatenate[Any, P], R]:
        @wraps(method)
        def call(self: Any, *args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = signature.bind(self, *args, **kwargs)
            except TypeError as error:
                problem = call_problem(label, method, (self, *args), dict(kwargs), bound=True)
                raise ArgumentError(problem or str(error)) from None
            given.apply_defaults()
            return body(**given.arguments)

        call.__doc__, call.__module__, call.__qualname__ = body.__doc__, __name__, f"NullLogger.{method.__name__}"
        return cast(Callable[Concatenate[Any, P], R], call)

    return wrapped


def _nothing(method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """Do nothing where `Logger` does something, and return nothing, an empty text or no number of the type it does."""
    made = _NOTHING[inspect.signature(method).return_annotation]

    def body(**_: object) -> R:
        """Do nothing."""
        return cast(R, made())

    return _like(method)(body)


class _NoFiles(SavedFiles):
    """What `NullLogger.save` returns."""

    path = os.devnull
    size_bytes = 0


class NullServing(Closing):
    """What `NullLogger.serve` returns: nothing listens."""

    alive = False
    foxglove_port = None

    def close(self) -> None:
        """Do nothing."""


class NullLogger(LoggerNames, Closing):
    """Takes every call of `Logger` and logs nothing. `array` returns ordinary zeros, so that the program works on."""

    is_running = False
    has_unsaved = False
    ticks = 0
    stop_reason = ""
    _conditions = NO_CONDITIONS

    @_like(Logger.__init__)
    def __init__(self, name: str, frequency: float, max_time: float, prefix: str, **_: object) -> None:
        """Take the arguments of `Logger`."""
        self.options = LoggerOptions(name=name, frequency_hz=frequency, max_time_s=max_time, prefix=prefix)
        self._infos: dict[str, ElementInfo] = {}
        self.parameters = Parameters()
        self._tunables = Tunables(self.options, self.add, LifeCycle(self.options.name), self.parameters)

    def collect(self) -> None:
        """Do nothing."""

    def mark(self, text: str = "mark", *more: object) -> None:
        """Mark nothing."""

    @_like(Logger.episode)
    def episode(self, name: str, success: bool | None, about: dict[str, object]) -> EpisodeBlock:
        """Mark nothing. Raises like `Logger.episode`."""
        return EpisodeBlock(self.mark, name, success, about)

    value = _nothing(Logger.value)
    update = _nothing(Logger.update)
    start = _nothing(Logger.start)
    stop = _nothing(Logger.stop)
    restart = _nothing(Logger.restart)
    close = _nothing(Logger.close)
    set = _nothing(Logger.set)
    load_script = _nothing(Logger.load_script)
    derive = _nothing(Logger.derive)
    limit = _nothing(Logger.limit)
    trigger = _nothing(Logger.trigger)
    stop_recording = _nothing(Logger.stop_recording)

    @property
    def elements(self) -> Elements:
        """What was added."""
        return Elements(self._infos.values(), self.options.prefix)

    @_like(Logger.add)
    def add(self, source: object, name: object, group: object, unit: object, attr: object, **_: object) -> None:
        """Log nothing; the name is in the table from now on."""
        if isinstance(source, VariableSet):
            for one in source.each:
                self.add(one.source, one.name, str(group), one.unit)
            return
        known = name or (str(attr).rsplit(".", 1)[-1] if attr else getattr(source, "__name__", ""))
        shape = tuple(getattr(source, "shape", ())) if attr is None else ()
        full = join_name(self.options.prefix, str(group), str(known))
        entries = tuple(Entry(suffix, "<f8") for suffix in index_suffixes(shape) or [""])
        self._infos.pop(full, None)
        self._infos[full] = ElementInfo(full, str(unit), kind_by_shape(shape).name, shape, entries, DEFAULT_OPTIONS)

    @_like(Logger.array)
    def array(self, name: str, shape: object, dtype: DTypeLike, options: dict[str, Any]) -> NDArray[Any]:
        """Return zeros of this shape and type. Raises like `Logger.array`."""
        made = np.zeros(*array_layout(shape, dtype))
        self.add(made, name, **options)
        return made

    parameter = of("_tunables", Tunables.parameter)  # that nobody but the program sets
    input = of("_tunables", Tunables.input)  # that nobody excites

    @_like(Logger.remove)
    def remove(self, name: str) -> int:
        """Forget an element or a whole namespace; how many there were."""
        known = self.elements.known
        gone = {known.names[place] for place, _ in known.find(name)}
        self._infos = {full: info for full, info in self._infos.items() if full not in gone}
        return len(gone)

    @_like(Logger.save_script)
    def save_script(self, path: str | os.PathLike[str] | None) -> Path:
        """Write nothing; the path that would have been written."""
        return file_path("path", path) if path else Path(self.options.script)

    @_like(Logger.snapshot)
    def snapshot(self) -> Recording:
        """Return an empty recording."""
        return Recording(self.options.name, np.empty(0, np.int64), 0, ())

    def _known(self, name: str) -> ElementInfo | None:
        known = self.elements.known
        found = known.find(name, namespaces=False)
        return self._infos[known.names[found[0][0]]] if len(found) == 1 else None

    def __getitem__(self, name: str) -> LoggedElement:
        info = self._known(name)
        if info is None:
            hint = self.elements.known.hint(name, f"the table has {many(len(self), 'element')}")
            raise ElementError(f"no element '{name}'{hint}")
        return LoggedElement(info)

    @_like(Logger.read_new_values)
    def read_new_values(self, name: str) -> NewValues:
        """Return no values, in the shape of the element."""
        info = self._known(name)
        return NewValues(np.empty(0, np.int64), np.empty((0, *(info.shape if info is not None else ()))), 0)

    @_like(Logger.save)
    def save(self, **_: object) -> SavedFiles:
        """Write nothing; no files, and `os.devnull` as the path of one."""
        return _NoFiles()

    @_like(Logger.record)
    def record(self, name: str, **_: object) -> str:
        """Record nothing."""
        return name

    @_like(Logger.serve)
    def serve(self, **_: object) -> NullServing:
        """Start nothing: nobody listens."""
        return NullServing()

    def __len__(self) -> int:
        return len(self._infos)

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._infos))

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._known(name) is not None

    def __repr__(self) -> str:
        return f"<NullLogger {self.name}: logs nothing>"

    def _repr_html_(self) -> str:
        return "<p><b>NullLogger</b>: logs nothing; silo.init() or silo.Logger() make one that does</p>"
