"""CSV -> a recording: tables with a column per entry, of silo and of others, and the original's rows.

CSV says neither types, units nor dividers: `<name>.csv.json` beside it does, where silo wrote both. Else types follow
from the texts (quoted: string), the divider of an entry from the ticks at which its cells are filled, and vectors are
put together again by their suffixes. Opening finds where the cells are (`silo.files.csv.cells`) and reads the time
stamps; the values of a column are read when they are asked for.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import shown
from silo.core.elements import BufferType, Entry
from silo.core.kinds import regroup
from silo.core.recording import RecordedElement, Recording, lazy_entry
from silo.errors import FileFormatError, LogNotFoundError, reason
from silo.files.csv.cells import DIGITS, LINE, QUOTE, Cells, Words, as_numbers, find_cells, first_record, records
from silo.files.csv.metadata import Column, NotThisTableError, restored, sidecar_of, spread, unpack
from silo.files.silo.format import decode_text, first_stamp

TIME_NS = "time_ns"  # the last column: the first one in whole nanoseconds
_ROUNDED_NS = 1500  # by which seconds that went through a double may be off
_SECOND = 1_000_000_000
_MOST_NS = 2**63
_MOST_DIGITS = 18  # of a number that surely is an int64
_DECIMAL = re.compile(rb"([+-]?)(\d+)(?:\.(\d*))?")
_TRUTHS = {b"true", b"false"}
_NO_TIME = (b"", b"nan", b"-nan", b"nat", b"null", b"none")
_NO_VALUE = (*_NO_TIME, b"na", b"n/a", b"#n/a", b"<na>")
_NUMBERS_BEGIN = list(b"0123456789+-.nNiI \t")
_ZONE = re.compile(r"(.*\d:\d.*?) ?(?:Z|([+-])(\d\d):?(\d\d)?)")  # behind the time of a day
_MOST_TOLD = 5


class _Unit(NamedTuple):
    """A unit of times: its name, the words for it, how many digits stand before nanoseconds, and how many of those."""

    name: str
    words: str
    digits: int
    times: int = 1


_SECONDS = _Unit("seconds", "s|secs?|seconds?", 9)
_UNITS = (
    _SECONDS,
    _Unit("milliseconds", "ms|msecs?|millis|milliseconds?", 6),
    _Unit("microseconds", "[uµμ]s|[uµμ]secs?|micros|microseconds?", 3),
    _Unit("nanoseconds", "ns|nsecs?|nanos|nanoseconds?", 0),
    _Unit("minutes", "mins?|minutes?", 9, 60),
    _Unit("hours", "h|hrs?|hours?", 9, 3600),
    _Unit("days", "days?", 9, 86400),
)
# behind a sign or, as in `stampMs`, a capital; or the whole name, but for `h` and the like
_UNIT = re.compile(
    r"(?i:(?:[_\s\[(/,.:-]\s*)({0})\s*[\])]?)$|(?<=[a-z])(?=[A-Z])(?i:({0}))$|^(?i:(?P<whole>{0}))$".format(
        "|".join(unit.words for unit in _UNITS)
    )
)
_TOO_SHORT = ("h", "s", "min", "mins")  # for a whole name
_LIKE_TIME = re.compile(
    r"time|stamp|date|clock|sec|elapsed|^(?:minutes|hours|days|micros|millis|nanos)$|^\W*t(?![a-z0-9])", re.IGNORECASE
)
_MOST_OFFSETS = 1_000_000
_BOM = b"\xef\xbb\xbf"


def read_csv(path: str | os.PathLike[str]) -> Recording:
    """Open a CSV file, of one column per entry (first column: time) or one row per entry.

    The time is in seconds, or in what its name says (`time_ms`, `t_us`, `stamp_ns`, `time [ms]`). What can't be
    understood is left out, with a warning of the recording. Raises `LogNotFoundError` if the file can't be opened,
    `FileFormatError` if it is empty or its first column (or rows) holds no time.
    """
    try:
        # no memory map: of a table that is written anew in its place values were mixed, or a signal ended the process
        data = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise LogNotFoundError(f"there is no file '{os.fspath(path)}'") from error
    except OSError as error:
        raise LogNotFoundError(f"can't open '{os.fspath(path)}': {reason(error)}") from error
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")  # lines as old spreadsheets end them
    try:
        return _parsed(np.frombuffer(data, np.uint8), Path(path))
    except FileFormatError as error:
        raise FileFormatError(f"'{os.fspath(path)}' can't be read as a log: {error}") from None


def _parsed(text: NDArray[np.uint8], path: Path) -> Recording:
    warnings: list[str] = []
    begin = len(_BOM) if text[: len(_BOM)].tobytes() == _BOM else 0
    head, begin = first_record(text, begin)
    if not head:
        raise FileFormatError("it is empty")
    if not any(cell.strip(b"\0") for cell in head):
        raise FileFormatError("it begins with bytes of value 0 alone: what was written is gone, as after a power cut")
    if len(head) == 1 and (sign := next((one for one in b";\t|" if one in head[0]), None)):
        raise FileFormatError(
            f"its columns are set apart by {chr(sign)!r}, not by ',': export it with commas, or write it anew: "
            f"pandas.read_csv(path, sep={chr(sign)!r}).to_csv(...)"
        )
    if _text(head[0]).endswith("time_s") and len(head) > 1 and re.fullmatch(rb"-?\d*", head[1]):
        rows = records(text, begin)
        if not head[-1] and text[-1] != LINE:  # each cell is followed by a comma, and each row by the end of its line
            warnings.append("its last row has no end, as where a file was cut off: its cells are those with a comma")
            rows = ([*row[:-1], b""] for row in rows if len(row) > 1)
        names, columns, time_ns = _from_rows(head, rows, warnings)
        prefix = _text(head[0]).removesuffix("time_s").removesuffix("/")
    else:
        names, columns, time_ns = _from_columns(head, find_cells(text, begin, len(head)), warnings)
        prefix = "/log"
    facts = _facts_beside(path)
    if facts is not None:
        try:
            recording = restored(unpack(facts), names, columns, time_ns, path)
            return replace(recording, warnings=(*recording.warnings, *warnings))
        except NotThisTableError as error:
            warnings.append(
                f"'{sidecar_of(path.name)}' is not of this table ({error}): "
                "units, labels, types and buffers of the log are not known"
            )
    return _recording(path.stem, prefix, time_ns, names, columns, warnings)


def damage_of_csv(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """What reading a table finds that the facts beside it don't tell; nothing of one without them. Raises as that."""
    stored: tuple[str, ...] = ()
    if (beside := _facts_beside(Path(path))) is None:
        return stored
    with contextlib.suppress(NotThisTableError):
        stored = unpack(beside).log.warnings
    return tuple(text for text in read_csv(path).warnings if text not in stored)


def _facts_beside(path: Path) -> bytes | None:
    try:
        return sidecar_of(path).read_bytes()
    except OSError:
        return None


# ---------------------------------------------------------------------------------------------------- text to columns


def _text(cell: bytes) -> str:
    return decode_text(cell.removeprefix(QUOTE))


def _from_columns(
    head: list[bytes], cells: Cells, warnings: list[str]
) -> tuple[list[str], list[Column], NDArray[np.int64]]:
    width = len(head)
    warnings += [
        f"record {number} has {count} cells where the header has {width}; it is left out" for number, count in cells.odd
    ]
    if cells.unclosed >= 0:
        where = _where(cells, head, cells.unclosed)
        warnings.append(f"{where} has a quote that is never closed: its cell ends where it would without")
    if not cells.text.min(initial=1):
        where = _where(cells, head, int(cells.text.argmin()))
        warnings.append(
            f"{where} has a byte of value 0: at the end of a cell it is left out; look at what wrote the file"
        )
    sizes = cells.sizes
    if cells.odd and not len(sizes):
        raise FileFormatError(f"none of its records has {width} cells, as its first one has")
    cells, sizes = _timed(cells, sizes, warnings)
    longest, shortest, letters = sizes.max(axis=0, initial=0), sizes.min(axis=0, initial=1), cells.letters()
    everywhere = np.arange(len(sizes))
    words = cells.column(0)
    bare = len(words) > 0 and bytes(words[0]).startswith(QUOTE)  # who quotes times quotes everything
    column = (lambda number, rows: np.char.lstrip(cells.column(number, rows), QUOTE)) if bare else cells.column
    columns = []
    for number in range(width):
        places = everywhere if shortest[number] else np.flatnonzero(sizes[:, number])
        # of texts of other letters the type must be looked at: dates have signs, too
        surely = not cells.sampled and letters[number] == DIGITS and longest[number] <= _MOST_DIGITS
        kind = np.dtype(np.int64) if surely else None
        columns.append(Column(places, partial(column, number, places), kind, int(letters[number])))
    names = [_text(cell) or f"column_{number}" for number, cell in enumerate(head, start=1)]
    if width > 1 and names[-1] == TIME_NS and len(columns[-1].places) == len(words):
        counted, seconds = _numbers(columns[-1].words()), _converted(words, np.dtype(np.float64))
        # else somebody edited the seconds, or the file was cut there
        if counted is not None and counted.dtype == np.int64 and seconds is not None:
            near = np.abs(seconds * 1e9 - counted) <= _ROUNDED_NS
            if near.all():
                return names[1:-1], columns[1:-1], counted
    time_ns, unit = _time(names[0], words)
    end = width
    if width > 1 and names[-1] == TIME_NS:
        end -= 1
        warnings.append(f"its last column, '{TIME_NS}', is not '{names[0]}' in nanoseconds: it is left out")
    if not _LIKE_TIME.search(names[0]):
        warnings.append(
            f"its first column, {shown(names[0])}, is taken as the time{unit}: a table of signals "
            "needs one before them, called time, time_ms or time_ns"
        )
    return names[1:end], columns[1:end], time_ns


def _where(cells: Cells, head: list[bytes], place: int) -> str:
    """The line, and the column of a record that is read, in which a byte stands."""
    line = f"line {1 + int(np.count_nonzero(cells.text[:place] == LINE))}"
    row = int(np.searchsorted(cells.starts, place, "right")) - 1
    column = int(np.searchsorted(cells.ends[row], place)) if row >= 0 else len(head)
    return f"{line}, column '{_text(head[column])}'" if column < len(head) else line


def _from_rows(
    head: list[bytes], records: Iterator[list[bytes]], warnings: list[str]
) -> tuple[list[str], list[Column], NDArray[np.int64]]:
    second = next(records, [b""])
    if not _text(second[0]).endswith("time_ns"):
        raise FileFormatError("after the row 'time_s' comes no row 'time_ns'")
    seconds, nanoseconds = _numbers(_cells_of(head)), _numbers(_cells_of(second))
    if seconds is None or nanoseconds is None or "f" in seconds.dtype.kind + nanoseconds.dtype.kind:
        raise FileFormatError("the rows 'time_s' and 'time_ns' must hold whole numbers")
    stamps = min(len(seconds), len(nanoseconds))
    pairs = zip(seconds[:stamps].tolist(), nanoseconds[:stamps].tolist(), strict=True)
    time_ns = _stamps([second * _SECOND + nanosecond for second, nanosecond in pairs])
    names: list[str] = []
    columns: list[Column] = []
    for number, record in enumerate(records, start=3):
        cells = _cells_of(record)
        if len(cells) > stamps:
            warnings.append(f"row {number} has {len(cells)} cells for {stamps} ticks; it is left out")
            continue
        names.append(_text(record[0]))
        words = np.array(cells, "S") if cells else np.empty(0, "S1")
        places = np.flatnonzero(np.char.str_len(words))
        columns.append(Column(places, partial(words.__getitem__, places), None, None))
    return names, columns, time_ns


def _cells_of(row: list[bytes]) -> list[bytes]:
    """The cells behind the name; each is followed by a comma, so that the last one is empty."""
    return row[1:-1] if len(row) > 1 and not row[-1] else row[1:]


# --------------------------------------------------------------------------------------------------- columns to values


def _timed(cells: Cells, sizes: Any, warnings: list[str]) -> tuple[Cells, Any]:
    """The records that have a time, and the sizes of their cells."""
    firsts = cells.text[np.minimum(cells.starts, len(cells.text) - 1)]
    doubtful = np.flatnonzero((sizes[:, 0] == 0) | ~np.isin(firsts, np.frombuffer(b"0123456789+-.", np.uint8)))
    words = np.char.lower(np.char.strip(np.char.lstrip(cells.column(0, doubtful), QUOTE)))
    there = np.ones(len(sizes), bool)
    there[doubtful] = ~np.isin(words, _NO_TIME)
    if there.all():
        return cells, sizes
    if not there.any():
        raise FileFormatError("its first column holds no time: it is empty")
    numbers = np.setdiff1d(np.arange(2, 2 + len(there) + len(cells.odd)), [number for number, _ in cells.odd])[~there]
    numbers = numbers[sizes[~there].any(axis=1)]  # of a line of commas nothing is left out
    left = f"record {', '.join(map(str, numbers[:_MOST_TOLD]))}{', ...' if len(numbers) > _MOST_TOLD else ''}"
    warnings += [f"{left} has no time in the first column; {len(numbers)} left out"] if len(numbers) else []
    return cells._replace(starts=cells.starts[there], ends=cells.ends[there]), sizes[there]


def _unit_of(name: str) -> _Unit:
    """The unit that the name of a column of times tells; seconds where it tells none."""
    said = _UNIT.search(name.strip())
    word = next(filter(None, said.groups()), "") if said is not None else ""
    if not word or (said is not None and said["whole"] and word.lower() in _TOO_SHORT):
        return _SECONDS
    return next(unit for unit in _UNITS if re.fullmatch(unit.words, word, re.IGNORECASE))


def _time(name: str, cells: Words) -> tuple[NDArray[np.int64], str]:
    """Nanoseconds of a time column, exact for decimal texts, and their unit, fit to show."""
    texts: list[bytes] = np.char.lstrip(cells, QUOTE).tolist()
    unit = _unit_of(name)
    if not unit.digits:
        whole = _numbers(texts)
        if whole is not None and whole.dtype == np.int64:
            return whole, f" in {unit.name}"
    matches = [_DECIMAL.fullmatch(text) for text in texts]
    if all(matches):
        exact = [_nanoseconds(match, unit) for match in matches if match]
        if any(far := [abs(number) >= _MOST_NS for number in exact]):
            raise _too_far(name, texts[far.index(True)], unit)
        return np.array(exact, np.int64), f" in {unit.name}"
    numbers = _numbers(texts)
    if numbers is not None:
        scaled = np.round(numbers.astype(np.float64) * (10.0**unit.digits * unit.times))
        if not (near := np.abs(scaled) < _MOST_NS).all():
            raise _too_far(name, texts[int(near.argmin())], unit)
        return scaled.astype(np.int64), f" in {unit.name}"
    others = [text for text, match in zip(texts, matches, strict=True) if match is None]
    with contextlib.suppress(ValueError):
        if len(others) == len(texts):  # else a number would be a year
            return np.array([_in_utc(decode_text(text)) for text in texts], "M8[ns]").view(np.int64), ""
    raise FileFormatError(
        f"its first column ({shown(name)}) holds no time in {unit.name}: '{decode_text(others[0])[:40]}'"
    )


def _too_far(name: str, text: bytes, unit: _Unit) -> FileFormatError:
    says = f"its first column ('{name}') says '{decode_text(text)[:40]}', and in {unit.name}"
    way_out = f": if they are others, call it '{name}_ns', '{name}_us' or '{name}_ms'" if unit.digits else ""
    return FileFormatError(f"{says} that is not within the years 1678 to 2262{way_out}")


def _in_utc(text: str) -> np.datetime64:
    """A time as ISO 8601 has it, of which NumPy knows no zones. Raises ValueError."""
    match = _ZONE.fullmatch(text.strip())
    if match is None:
        return np.datetime64(text, "ns")
    minutes = int(match[3] or 0) * 60 + int(match[4] or 0)
    return np.datetime64(match[1], "ns") - np.timedelta64(-minutes if match[2] == "-" else minutes, "m")


def _stamps(numbers: list[int]) -> NDArray[np.int64]:
    wrong = next((number for number in numbers if abs(number) >= _MOST_NS), None)
    if wrong is not None:
        raise FileFormatError(f"time stamp {wrong} ns is out of range: 63 bits, the years 1678 to 2262")
    return np.array(numbers, np.int64)


def _nanoseconds(match: re.Match[bytes], unit: _Unit) -> int:
    """Of a decimal number, of whose point nanoseconds stand so many digits behind."""
    finer = 0 if unit.times == 1 else 6  # digits
    digits = unit.digits + finer
    stamp: int = int(match[2] + (match[3] or b"").ljust(digits, b"0")[:digits]) * unit.times // 10**finer
    return -stamp if match[1] == b"-" else stamp


def _numbers(texts: Sequence[bytes] | Words) -> NDArray[Any] | None:
    """The values if all texts are numbers: int64, else uint64, else float64."""
    if not len(texts):
        return np.empty(0, np.int64)
    cells = np.asarray(texts, "S")
    for dtype in (np.int64, np.uint64, np.float64):
        values = _converted(cells, np.dtype(dtype))
        if values is not None:
            return values
    return None


def _converted(cells: Words, dtype: np.dtype[Any]) -> NDArray[Any] | None:
    try:
        return as_numbers(cells, dtype)
    except (ValueError, OverflowError):
        return None


def _values(words: Callable[[], Words]) -> NDArray[Any]:
    """The values of filled cells: numbers, or texts, which stay bytes."""
    cells = words()
    if len(cells) and cells[0].lower() in _TRUTHS and set(map(bytes.lower, cells.tolist())) <= _TRUTHS:
        return np.asarray(np.char.lower(cells) == b"true")
    values = None if np.char.startswith(cells, QUOTE).any() else _numbers(cells)
    return np.array([cell.removeprefix(QUOTE) for cell in cells.tolist()], "S") if values is None else values


def _looked_at(name: str, column: Column, warnings: list[str]) -> tuple[Column, NDArray[Any]]:
    """A column with its type, and its values. Where a word says that one is missing, it is as if its cell was empty.

    Of texts that are numbers but for a few it is told which made texts of all.
    """
    values = _values(column.words)
    if values.dtype.kind == "S":
        cells = column.words()
        kept = np.flatnonzero(~np.isin(np.char.lower(np.char.strip(cells)), _NO_VALUE))
        others = _values(partial(cells.__getitem__, kept))
        if len(kept) and others.dtype.kind != "S":
            column, values = column._replace(places=column.places[kept]), others
        elif told := _why_texts(cells):
            warnings.append(f"column '{name}' is taken as texts: {told}")
    return column._replace(dtype=values.dtype), values


def _why_texts(cells: Words) -> str:
    """What keeps most cells of a column from being the numbers that they look like; empty where they don't."""
    words, first, counts = np.unique(cells, return_index=True, return_counts=True)
    is_number = np.isin(words.view(np.uint8).reshape(len(words), -1)[:, 0], _NUMBERS_BEGIN)
    is_number[is_number] = [_numbers([word]) is not None for word in words[is_number].tolist()]
    numbers = int(counts[is_number].sum())
    if numbers * 2 < len(cells):
        return ""
    odd = cells[first[~is_number].min()]
    return f"{len(cells) - numbers:,} of {len(cells):,} cells are no numbers, the first is {shown(_text(odd))}"


def _stepping(places: NDArray[np.intp], rows: int) -> tuple[int, int, int]:
    """The first row of a column, how many lie between two, and how many there are; 0, 1 and all without a pattern."""
    steps = np.diff(places)
    divider = int(steps[0]) if len(steps) else 1
    # gaps without a pattern, as other tools leave them for NaN, and silo for whole numbers that are missing
    return (int(places[0]), divider, len(places)) if (steps == divider).all() else (0, 1, rows)


def _spread(load: Callable[[], NDArray[Any]], places: NDArray[np.intp], count: int) -> NDArray[Any]:
    """The values of a column; of one without a pattern a value for each row, of which some are missing."""
    return spread(load(), places, count)


def _recording(
    stem: str,
    prefix: str,
    time_ns: NDArray[np.int64],
    names: Sequence[str],
    columns: Sequence[Column],
    warnings: list[str],
) -> Recording:
    stamps = len(time_ns)
    found = []
    for name, column in zip(names, columns, strict=True):
        if len(column.places):
            known, values = _looked_at(name, column, warnings) if column.dtype is None else (column, None)
            load = partial(_values, column.words) if values is None else partial(np.asarray, values)
            found.append((name, _stepping(known.places, stamps), known, load))
    elements: list[RecordedElement] = []
    for group in regroup([name for name, *_ in found], [(*steps, one.dtype.kind) for _, steps, one, _ in found]):
        members = found[group.start : group.start + len(group.suffixes)]
        first, divider, count = members[0][1]
        entries = tuple(
            lazy_entry(name, Entry(suffix, one.dtype.str), partial(_spread, load, one.places, count), one.dtype, count)
            for (name, _, one, load), suffix in zip(members, group.suffixes, strict=True)
        )
        newest = first > 0 and stamps - 1 - (first + (count - 1) * divider) < divider
        buffer_type = BufferType.LOOPING if newest else BufferType.GROWING
        elements.append(RecordedElement(group.name, "-", group.kind, group.shape, divider, buffer_type, first, entries))
    looping = bool(elements) and all(element.buffer_type is BufferType.LOOPING for element in elements)
    offset = _likely_offset(elements, stamps)
    return Recording(stem, time_ns, offset, elements, prefix, time_looping=looping, warnings=tuple(warnings))


def _likely_offset(elements: Sequence[RecordedElement], stamps: int) -> int:
    """The smallest count of ticks that explains which ticks the looping elements have; `stamps` if none does."""
    looping = [element for element in elements if element.buffer_type is BufferType.LOOPING]
    offsets = np.arange(stamps, stamps + _MOST_OFFSETS if looping else stamps)
    for divider, last in {(e.divider, e.first + (e.count - 1) * e.divider) for e in looping}:
        offsets = offsets[(offsets - 1) % divider == stamps - 1 - last]
    fits = [first_stamp(True, stamps, e.count, e.divider, int(offsets[0])) == e.first for e in looping if len(offsets)]
    return int(offsets[0]) if fits and all(fits) else stamps
