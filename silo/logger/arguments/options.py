"""What the arguments of `Logger` and of its methods may be, and what they become."""

import contextlib
import functools
import grp
import logging
import math
import numbers
import os
import re
import secrets
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, SupportsIndex

import msgspec
import numpy as np

from silo.core.arguments import line, path, real, shown, switch, text, whole, word
from silo.core.elements import (
    DEFAULT_MAX_TIME_S,
    DEFAULT_OPTIONS,
    OWN_SCRIPT,
    SCRIPT_OF_ALL,
    Action,
    BufferType,
    Edit,
    ElementInfo,
    ElementOptions,
    LoggerOptions,
    Storage,
    Threads,
    join_name,
)
from silo.core.quantities.reading import HERTZ, SECONDS, read_amount
from silo.core.runtime import FOLDER_GONE
from silo.errors import ElementError, SourceError, reason
from silo.logger.arguments.provenance import about_run
from silo.loop.types import MAX_ENTRIES
from silo.segment.retention import end_text, kept_how
from silo.settings.options import option_problems, refusal
from silo.settings.typed import ElementSettings, apply_settings, read_options, whole_edits

log = logging.getLogger("silo")

NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
MAX_STRING_BYTES = 1_000_000
MAX_DIMENSIONS = 32  # of NumPy 1


def logger_options(
    *,
    name: str,
    frequency: float | str,
    max_time: float | str,
    script: str | os.PathLike[str] | bool | None,
    prefix: str,
    folder: str | os.PathLike[str],
    storage: str | Storage,
    size_tiers: int,
    memory_limit_mb: int,
    checked: bool,
    threads: str | Threads,
    about: Mapping[str, object] | None,
) -> LoggerOptions:
    """Return options with absolute paths. Raises ElementError that names the argument, its value and its range."""
    if not NAME_PATTERN.fullmatch(text("the logger's name", name, 'silo.Logger("robot")')):
        likely = re.sub(r"[^A-Za-z0-9_.-]+", "_", name).lstrip("_.-")[:40]
        way_out = f"; write silo.Logger({likely!r})" if likely else ""
        raise ElementError(
            f"logger name {name!r}: 1 to 40 letters, digits, '_', '-' or '.', a letter or digit first{way_out}"
        )
    return LoggerOptions(
        name=name,
        frequency_hz=real("frequency", _number(frequency, HERTZ), 0, 1e6, "Hz", include_low=False),
        max_time_s=real("max_time", _number(max_time, SECONDS), 0, 1e9, "s (0: no limit)"),
        prefix=_prefix(prefix),
        script=_script(name, script),
        folder=_absolute("folder", folder),
        storage=word("storage", storage, Storage),
        size_tiers=whole("size_tiers", size_tiers, 1, 1000),
        memory_limit_mb=whole("memory_limit_mb", memory_limit_mb, 1, 10**9),
        checked=switch("checked", checked),
        threads=word("threads", threads, Threads),
        id=secrets.token_hex(4),
        about=about_run(about),
    )


def _script(name: str, given: object) -> str:
    """Return where a logger's own script is, or is to be saved, also of one that reads none."""
    if not (given is None or isinstance(given, bool)):
        return _absolute("script", given)
    own, of_all = _absolute("script", f"{name}{OWN_SCRIPT}"), _absolute("script", SCRIPT_OF_ALL)
    return of_all if given and os.path.exists(of_all) and not os.path.exists(own) else own  # noqa: PTH110


def _number(given: object, units: Mapping[str, float]) -> object:
    """Return the number of `"60s"` or `"500Hz"`, in the unit of the argument; anything else as it is."""
    amount = read_amount(given)
    factor = units.get(amount[1].lower()) if amount is not None else None
    return given if amount is None or factor is None else amount[0] * factor


def _absolute(argument: str, given: object) -> str:
    asked = path(argument, given)
    try:
        return text(argument, str(asked.absolute()), f"{argument}='some/path'")
    except FileNotFoundError:
        raise ElementError(
            f"{argument} {shown(str(asked))} can't be found: {FOLDER_GONE}, or give a whole path"
        ) from None


def _prefix(given: object) -> str:
    stripped = line("prefix", given, 'prefix="/log"').strip("/")
    return join_name("", "", stripped) if stripped else ""


def element_name(source: object, name: object, attr: object) -> str:
    """Return the name of an element, told by its attribute or function where none is given. Raises ElementError."""
    if isinstance(source, str) and name is not None and not isinstance(name, str):
        raise ElementError(
            f"log.add takes the variable first and its name second, got {shown(source)} and "
            f"{shown(name)} ({type(name).__name__}); "
            f'write log.add({source if source.isidentifier() else "variable"}, "{source}")'
        )
    if name is None and attr is None and isinstance(source, str):
        raise ElementError(
            f"log.add takes the variable first and its name second, got {shown(source)} alone; write "
            f'log.add({source if source.isidentifier() else "variable"}, "{source}")'
        )
    if name is not None:
        given = text("the element's name", name, f'log.add({type(source).__name__.lower()}, "name")')
        if given and not given.strip(" /"):
            raise ElementError(f"element name {shown(given)}: write a name of more than blanks and '/'")
        if given:
            return given
    found = str(attr).rsplit(".", 1)[-1] if attr else getattr(source, "__name__", "")
    if not isinstance(found, str) or not found or found == "<lambda>":
        raise ElementError(f'give the element a name: log.add({type(source).__name__.lower()}, "name")')
    return found


def new_options(name: str, frequency_hz: float, max_time_s: float, *given: object) -> ElementOptions:
    """Return the options of a new element: enabled, divider, action, buffer and size, of which None is `max_time`.

    Raises ElementError.
    """
    if all(type(one) in _PLAIN for one in given):
        with contextlib.suppress(ElementError):  # which is to name this element
            return _alike(frequency_hz, max_time_s, *given)
    return _new_options(name, frequency_hz, max_time_s, *given)


_PLAIN = {bool, int, str, type(None), Action, BufferType}


@functools.lru_cache(maxsize=1024, typed=True)  # 1 is no bool, Action.SAVE no divider
def _alike(frequency_hz: float, max_time_s: float, *given: object) -> ElementOptions:
    return _new_options("", frequency_hz, max_time_s, *given)


def _new_options(name: str, frequency_hz: float, max_time_s: float, *given: object) -> ElementOptions:
    named = dict(zip(("enabled", "divider", "action", "buffer", "size"), given, strict=True))
    if named["size"] is None:
        del named["size"]
    settings = read_options(named, name)
    size = settings.pop("size", None)
    (first,) = apply_settings(settings, [(name, DEFAULT_OPTIONS)], frequency_hz)
    # the room for max_time, and what "*2" makes of it, follow the divider
    logger = LoggerOptions(frequency_hz=frequency_hz, max_time_s=max_time_s)
    default = msgspec.structs.replace(first, size=logger.default_buffer_size(first.divider))
    if size is None:
        problems = option_problems(name, default)
        way_out = f"that is max_time, {max_time_s:g} s at {frequency_hz:g} Hz: give a size"
        if problems:
            raise ElementError(refusal(problems).replace("; nothing", f" ({way_out}); nothing"))
        return default
    (options,) = apply_settings(ElementSettings(size=size), [(name, default)], frequency_hz)
    return options


def string_room(given: SupportsIndex | None) -> int | None:
    """The bytes to keep for a string, None for as many as it has now, 64 at least. Raises ElementError."""
    return None if given is None else whole("string_bytes", given, 1, MAX_STRING_BYTES)


def array_layout(shape: object, dtype: object) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """The lengths and the type of an array that `log.array` is to make.

    Raises ElementError for a shape that none has, SourceError for a type without a fixed size in memory.
    """
    example = 'write log.array("q", 12), log.array("R", (3, 3)) or log.array("n", dtype=int)'
    if isinstance(shape, str | bytes | type | np.dtype) or not isinstance(shape, numbers.Integral | Iterable):
        raise ElementError(f"shape must be a whole number or several of them, got {shown(shape)}; {example}")
    sizes = tuple(shape) if isinstance(shape, Iterable) else (shape,)
    try:
        lengths = tuple(whole("each length of shape", size, 0, MAX_ENTRIES) for size in sizes)
    except ElementError as error:
        raise ElementError(f"{error}; {example}") from None
    if len(lengths) > MAX_DIMENSIONS or math.prod(lengths) > MAX_ENTRIES:
        raise ElementError(
            f"shape must have at most {MAX_DIMENSIONS} dimensions and {MAX_ENTRIES} values together, got {shown(shape)}"
        )
    try:
        kind = np.dtype(dtype)  # type: ignore[call-overload]  # whatever it was given
    except (TypeError, ValueError, SyntaxError, OverflowError) as error:
        raise SourceError(
            f"dtype {shown(dtype)} is no type of NumPy ({error}); write dtype=float, 'f4', int, bool or 'S32'"
        ) from None
    if kind.hasobject or kind.itemsize == 0:
        raise SourceError(f"dtype {kind} has no fixed size in memory; for text give a length: dtype='S32'")
    return lengths, kind


def edits_given(edits: object, elements: Iterable[ElementInfo], prefix: str, frequency_hz: float) -> list[Edit]:
    """The edits of a transaction, each with all options. Raises ElementError for anything else."""
    if isinstance(edits, str | bytes | Mapping) or not isinstance(edits, Iterable):
        raise ElementError(f"edits must be a list of silo.Edit, got {shown(edits)}; log.set(name, ...) is simpler")
    found = list(edits)
    for one in found:
        right = isinstance(one, Edit) and isinstance(one.name, str)
        if not right or not isinstance(one.options, ElementOptions | dict):
            raise ElementError(f"an edit must be silo.Edit(name, divider=5), got {shown(one)}; nothing was changed")
    return whole_edits(found, elements, prefix, frequency_hz)


def serving_group(given: str | None) -> str | None:
    """The system group that may come in, by name or number. Raises ElementError for a name that nobody has here."""
    if given is None:
        return None
    name = line("group", given, 'group="robot"')
    if name.isdecimal():
        return name
    try:
        grp.getgrnam(name)
    except (KeyError, ValueError):
        raise ElementError(
            f"no group {shown(name)} on this system; make it with `groupadd {name or 'robot'}`; the logger isn't served"
        ) from None
    return name


def serving_config(given: str | os.PathLike[str] | None) -> Path | None:
    """The file with remote access settings. Raises ElementError for what can't be read."""
    if given is None:
        return None
    file = path("config", given).absolute()
    try:
        file.open("rb").close() if file.is_file() else file.stat()
    except OSError as error:
        raise ElementError(f"config: can't read {file} ({reason(error)}); the logger isn't served") from None
    if not file.is_file():
        raise ElementError(f"config must be a file, {file} is none; the logger isn't served; see config/ for examples")
    return file


def warn_if_not_durable(options: LoggerOptions, *, served: bool) -> None:
    """Say at a start that a logger without helper process keeps no journal, whatever its storage was asked to be."""
    if options.storage is Storage.DISK and not served:
        log.warning(
            "%s: storage='disk' keeps its journal in the helper process, and this logger has none: nothing is durable, "
            "a power cut loses what was not saved; call serve() before start()",
            options.name,
        )


def warn_of_folder(options: LoggerOptions) -> None:
    """Say at a start where nothing can be saved, rather than when it is to be."""
    there = folder = Path(options.folder)
    while not os.path.exists(there) and there != there.parent:  # noqa: PTH110  # which raises nothing
        there = there.parent
    is_folder = os.path.isdir(there)  # noqa: PTH112
    if is_folder and os.access(there, os.W_OK | os.X_OK):
        return
    why = f"{there} can't be written to" if is_folder else f"{there} is no folder"
    log.warning("%s: saves to %s will fail: %s; save(folder=...) saves elsewhere", options.name, folder, why)


def end_at_start(options: LoggerOptions, table: Iterable[ElementInfo]) -> str:
    """Return that a run ends by itself that would go on, were all its buffers looping or growing, without `max_time`.

    Not where that was given, and none of its buffers would go on.
    """
    kept = kept_how(table)
    is_meant = options.max_time_s != DEFAULT_MAX_TIME_S and BufferType.LOOPING not in kept.values()
    return "" if is_meant else end_text(kept, options.max_time_s)


def warn_of_end(options: LoggerOptions, words: str) -> None:
    """Say that, where a run ends by itself."""
    if words:
        log.warning("%s: %s", options.name, words)
