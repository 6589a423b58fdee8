"""A ULog of PX4 (`.ulg`), read by `pyulog`: topics with their own times, messages as marks, parameters as they changed.

ULog has no units. Times count from the start of the flight computer (its file format:
https://docs.px4.io/main/en/dev_log/ulog_file_format.html). A topic that is logged several times gets its number:
`/battery_status_1`.
"""

import contextlib
import io
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, Entry, LoggedEvent, join_name
from silo.core.kinds import index_suffixes, kind_by_shape
from silo.core.quantities.writing import many
from silo.core.recording import RecordedElement, RecordedEntry, Recording, common_axis
from silo.core.tuning.parameters import ParameterChange
from silo.errors import FileFormatError
from silo.files.optional_packages import need

_FIELD = re.compile(r"(?P<name>.*)\[(?P<index>\d+)\]")
_STAMP = "timestamp"
_MOST_MICROS = 2**53  # 285 years: a stamp above is damaged
_HEADER_BYTES, _MESSAGE = 16, struct.Struct("<HB")  # of a file; of a message its bytes behind these, and its type
Stamps = NDArray[np.int64]


def read_ulog(path: Path) -> Recording:
    """Read a ULog. Raises FileFormatError for one that is damaged from the begin, SiloError without `pyulog`."""
    core: Any = need("pyulog.core", "bags", "ULogs")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):  # the package tells of damage there
            found = core.ULog(str(path))
    except Exception as error:
        raise FileFormatError(f"'{path}' can't be read as a ULog: {type(error).__name__}: {error}") from error
    try:
        return _recording(path, found)
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError) as error:  # of what damage made of it
        raise FileFormatError(f"'{path}' is damaged: {type(error).__name__}: {error}") from error


def _recording(path: Path, found: Any) -> Recording:
    topics = [one for one in found.data_list if _STAMP in one.data and len(one.data[_STAMP])]
    if not topics:
        raise FileFormatError(f"'{path}' is a ULog without a message")
    several = {one.name for one in topics if one.multi_id}
    elements: list[RecordedElement] = []
    stamps: list[Stamps] = []
    warnings = []
    for one in topics:
        name = f"/{one.name}" if one.name not in several else f"/{one.name}_{one.multi_id}"
        micros = one.data[_STAMP]
        order = np.argsort(micros, kind="stable")
        order = order[micros[order] <= _MOST_MICROS]
        if len(order) < len(micros):
            warnings.append(f"{name}: {many(len(micros) - len(order), 'message')} without a time left out")
        stamps.append(micros[order].astype(np.int64) * 1000)
        elements += _elements(name, {field: values[order] for field, values in one.data.items()}, stamps[-1])
    axis = common_axis(stamps)
    if found.file_corruption:
        warnings.append("the file is damaged: what follows the damage may be missing")
    elif _is_cut(path, max([_HEADER_BYTES, *found._appended_offsets])):
        warnings.append("the file ends within a message, as after a power cut: what followed is missing")
    lost_s = sum(one.duration for one in found.dropouts) * 1e-3
    if lost_s:
        warnings.append(f"its logger lost {lost_s:g} s in {many(len(found.dropouts), 'dropout')}")
    return Recording(
        logger=path.stem,
        time_ns=axis,
        offset=len(axis),
        elements=tuple(elements),
        prefix="",
        warnings=tuple(warnings),
        events=tuple(_events(found, axis)),
        about={str(key): _text(value) for key, value in sorted(found.msg_info_dict.items())},
    )


def _is_cut(path: Path, begin: int) -> bool:
    """Whether the last message is not whole, of those from this byte on: the package ends before it without a word."""
    data = path.read_bytes()
    while begin + _MESSAGE.size <= len(data):
        begin += _MESSAGE.size + int(_MESSAGE.unpack_from(data, begin)[0])
    return begin != len(data)


def _elements(topic: str, data: dict[str, NDArray[Any]], own_ns: Stamps) -> Iterator[RecordedElement]:
    """The fields of a topic: `q[0]`, `q[1]` ... are one element."""
    fields: dict[str, dict[int, NDArray[Any]]] = {}
    for name, values in data.items():
        if name == _STAMP:
            continue
        match = _FIELD.fullmatch(name)
        place = fields.setdefault(match["name"] if match else name, {})
        place[int(match["index"]) if match else -1] = values
    for name, parts in fields.items():
        whole = join_name("", topic, name.replace(".", "/"))
        shape = (len(parts),) if -1 not in parts else ()
        suffixes = index_suffixes(shape) or [""]
        entries = tuple(
            RecordedEntry(
                whole + suffix,
                Entry(suffix, values.dtype.newbyteorder("<").str),
                np.ascontiguousarray(values.astype(values.dtype.newbyteorder("="), copy=False)),
            )
            for suffix, (_, values) in zip(suffixes, sorted(parts.items()), strict=True)
        )
        yield RecordedElement(
            name=whole,
            unit="-",
            kind=kind_by_shape(shape).name,
            shape=shape,
            divider=1,
            buffer_type=BufferType.GROWING,
            first=0,
            entries=entries,
            own_ns=own_ns,
        )


def _events(found: Any, axis: Stamps) -> Iterator[LoggedEvent]:
    """Messages as marks, and what parameters were from the start on and became."""
    known: dict[str, float | int] = {str(name): _number(value) for name, value in found.initial_parameters.items()}
    told: list[tuple[int, str, str, ParameterChange | None]] = []
    if known:
        values = tuple((name, None, value) for name, value in sorted(known.items()))
        told.append(
            (int(axis[0]) if len(axis) else 0, "parameter", many(len(values), "parameter"), ParameterChange(values))
        )
    for micros, name, value in found.changed_parameters:
        new = _number(value)
        old = known.get(name, new)
        known[name] = new
        told.append((int(micros) * 1000, "parameter", f"{name} {old} -> {new}", ParameterChange(((name, old, new),))))
    told += [
        (int(one.timestamp) * 1000, "marker", f"{one.log_level_str()}: {one.message}", None)
        for one in found.logged_messages
    ]
    for number, (stamp, kind, text, change) in enumerate(sorted(told, key=lambda one: one[0])):
        tick = max(0, int(np.searchsorted(axis, stamp, "right")) - 1)
        yield LoggedEvent(kind, text, stamp, tick, stamp, "PX4", number=number, change=change)


def _number(value: Any) -> float | int:
    if isinstance(value, bytes):
        raise TypeError(f"a parameter of a type that ULogs don't have: {value!r}")
    return float(value) if isinstance(value, float | np.floating) else int(value)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
