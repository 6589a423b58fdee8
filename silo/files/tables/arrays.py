"""A recording -> files of arrays: NumPy's `.npz`, MATLAB's `.mat`, HDF5.

An element's samples stand together with their time stamps, so that nobody has to know silo's rules of time.
"""

import io
import math
import re
import zipfile
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, RecordedEntry, Recording, silent, stamps_of
from silo.errors import FileFormatError, SaveError
from silo.files.optional_packages import need, whole_file
from silo.files.silo.format import FilledEntry, dtype_from
from silo.files.silo.missing import filled, in_doubles, is_masked
from silo.files.tables.facts import NAME, Place, packed, restored, told_of, unpacked
from silo.files.tables.matlab_variables import MatlabVariables
from silo.files.texts import numbered, presentable, unique_names

# MATLAB cuts longer names
_MATLAB_NAME = 63
_UP = re.compile(r"(?<![^/])\.\.(?![^/])")  # what unpacks a zip would leave its folder by it
_MATLAB_BYTES = 2**31 - 1
_LETTER_BYTES = 4  # of a text of NumPy's own; ours have one
_MOST_FACTS_BYTES = 64 * 2**20  # and four times as much, of letters


def write_npz(recording: Recording, path: Path, progress: Progress = silent) -> None:
    """Write one array per entry under the entry's name without the leading `/`, and `time_ns` (int64).

    An element that has not exactly one sample per tick has its own `<element>.time_ns`. What arrays can't say (units,
    labels, dividers) stands in `silo.json`, a 0-d string. Where whole numbers are missing, `<entry>.missing` (bool)
    says which, and a number that no sample is stands there. Raises `SaveError`.
    """
    recording = presentable(recording)
    # file systems and MATLAB don't tell upper from lower case
    unique = unique_names(lambda name: _UP.sub("__", name.lstrip("/").replace("\0", "_")) or "unnamed", str.lower)
    total = max(1, len(recording.elements))
    with whole_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        _add(archive, unique("time_ns"), recording.time_ns)
        _add(archive, unique("silo.json"), np.array(_facts(recording)))
        places: list[Place] = []
        own: dict[int, str] = {}
        elements = [filled(element) for element in recording.elements]
        for done, (element, written) in enumerate(zip(recording.elements, elements, strict=True)):
            for entry, values in zip(element.entries, written.entries, strict=True):
                places.append((unique(entry.name), -1))
                _add(archive, places[-1][0], values.values)
                if is_masked(entry.values):
                    _add(archive, unique(f"{entry.name}.missing"), np.ma.getmaskarray(entry.values))
            if element.count != len(recording.time_ns) or element.own_ns is not None:
                name = unique(f"{element.name}.time_ns")
                _add(archive, name, stamps_of(recording, element))
                own |= {} if element.own_ns is None else {done: name}
            progress((done + 1) / total)
        _add(archive, unique(NAME), np.array(packed(recording, elements, places, own)))


def read_npz(path: Path) -> Recording:
    """Open a file that `write_npz` wrote; an array is read when it is asked for."""
    with told_of(path):
        arrays = np.load(path, allow_pickle=False)
        text = str(_member(arrays, NAME, (), _MOST_FACTS_BYTES)) if NAME in arrays else None
        return restored(
            path,
            text,
            lambda: arrays.zip.getinfo("time_ns.npy").file_size // 8,
            lambda: arrays["time_ns"],
            lambda place, _, count, dtype: _member(arrays, place[0], (count,), dtype.itemsize),
        )


def _member(arrays: Any, name: str, shape: tuple[int, ...], item_bytes: int) -> NDArray[Any]:
    """An array of this shape, with values of so many bytes. FileFormatError for another one, before it is unpacked."""
    with arrays.zip.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        of_version = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        read = of_version.get(version)
        found, _, dtype = read(member) if read is not None else ((), False, np.dtype("V"))
    if found != shape:
        raise FileFormatError(f"'{name}' has the shape {found}, not {shape}")
    if dtype.itemsize > max(item_bytes, 8) * _LETTER_BYTES:
        raise FileFormatError(f"the values of '{name}' have {dtype.itemsize:,} bytes each, not {item_bytes:,}")
    return np.asarray(arrays[name])


def _add(archive: zipfile.ZipFile, name: str, values: NDArray[Any]) -> None:
    if values.dtype.hasobject:
        raise SaveError(f"{name}: Python objects can't be stored in an .npz file; leave the element out")
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)


def write_mat(recording: Recording, path: Path, progress: Progress = silent) -> None:
    """Write one struct per element: `name`, `unit`, `kind`, `divider`, `looping`, `time` (s from the first stamp),
    `first`, `lost`, `failed`, `failed_ticks` (first and last tick since start of each stretch that could not be read,
    in rows) and `data` (samples x entries; a struct of columns where types differ), and a struct `silo` of the log with
    all stamps: those of an element in ns are `silo.time_ns(first : divider : first + divider * (numel(time) - 1))`.
    Where whole numbers are missing, `data` is double with NaN; where doubles don't hold the others, `missing` is the
    number that stands there, and no sample.

    Variables are the elements' names with what MATLAB forbids as `_`. Raises `SaveError` for more than 2 GB per
    element, which the format can't hold, and `SiloError` without scipy.
    """
    recording = presentable(recording)
    matlab = need("scipy.io", "convert", ".mat files")
    unique = unique_names(_variable, str.lower)
    start = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    about = {
        "logger": recording.logger,
        "frequency_hz": np.nan if recording.frequency_hz is None else recording.frequency_hz,
        "started_ns": np.int64(recording.started_ns),
        "time_ns": recording.time_ns,
        "time": _seconds(recording.time_ns, start),
    }
    if recording.warnings:
        about["warnings"] = np.array([text.replace("\0", "_") for text in recording.warnings], dtype=object)
    if recording.events:
        about["event_ticks"] = np.array([event.tick for event in recording.events], np.int64)
        about["events"] = np.array([f"{event.kind}: {event.text}" for event in recording.events], dtype=object)
    total = max(1, len(recording.elements))
    with whole_file(path) as file:
        unique("silo")
        names = [unique(element.name) for element in recording.elements]
        names = [f"x{name}" if name[0].isdigit() or name[0] == "_" else name for name in names]
        elements = [in_doubles(element) for element in recording.elements]
        places = [(name if data is None else f"{name}.{data}", at if data is None else -1)
                  for name, element in zip(names, elements, strict=True)
                  for at, data in enumerate(_matlab_fields(element))]  # fmt: skip
        own = {place: name for place, name in enumerate(names) if recording.elements[place].own_ns is not None}
        about["log"] = packed(recording, elements, places, own)
        matlab.savemat(file, {"silo": about}, do_compression=True, long_field_names=True, oned_as="column")
        for done, (name, element) in enumerate(zip(names, recording.elements, strict=True), start=1):
            struct = _matlab_struct(recording, element, start)
            matlab.savemat(file, {name: struct}, do_compression=True, long_field_names=True, oned_as="column")
            progress(done / total)


def read_mat(path: Path) -> Recording:
    """Open a file that `write_mat` wrote; a variable is read when a signal of it is asked for."""
    matlab = need("scipy.io", "convert", ".mat files")

    sizes: Counter[str] = Counter()

    @lru_cache(maxsize=8)
    def struct(name: str) -> Any:
        return variables.read(name, sizes[name])[0, 0]

    def values(place: Place, *_: object) -> NDArray[Any]:
        name, dot, field = place[0].partition(".")
        data: Any = struct(name)["data"]
        if place[1] >= 0:
            return np.asarray(data[:, place[1]])
        if not dot:  # stamps of its own
            start = int(about["time_ns"].ravel()[0])
            return np.asarray(np.rint(struct(name)["time"].ravel() * 1e9).astype(np.int64) + start)
        data = data[field][0, 0] if data.dtype.names else data
        if data.dtype.kind == "O":
            return np.array([str(cell[0]) if cell.size else "" for cell in data.ravel()])
        return np.asarray(data if data.shape[-1] > 1 else data.ravel())

    with told_of(path):
        variables = MatlabVariables(path, matlab)
        about: Any = variables.read("silo")[0, 0] if "silo" in variables else np.empty(0)
        text = str(about["log"].ravel()[0]) if "log" in (about.dtype.names or ()) else None
        if text is not None:
            sizes.update(_matlab_sizes(path, text))
        return restored(path, text, lambda: int(about["time_ns"].size), lambda: about["time_ns"], values)


def _matlab_sizes(path: Path, text: str) -> dict[str, int]:
    """How many bytes the variable of each element may have: far more than its samples take, as cells at worst."""
    facts = unpacked(path, text)
    places = iter(facts.places)
    found: Counter[str] = Counter()
    for number, one in enumerate(facts.elements):
        names = {place[0].partition(".")[0] for _, place in zip(one.entries, places, strict=False)}
        names |= {facts.own[number]} if number in facts.own else set()
        widths = [dtype.itemsize if (dtype := dtype_from(entry.dtype)) is not None else 0 for entry in one.entries]
        for name in names:
            found[name] += 16 * len(text) + 2**20 + max(0, one.count) * sum(128 + 4 * width for width in widths)
    return found


def _matlab_struct(recording: Recording, element: RecordedElement, start: int) -> dict[str, Any]:
    times = stamps_of(recording, element)
    written = in_doubles(element).entries
    columns = [_matlab_values(entry.values) for entry in written]
    size = sum(column.nbytes for column in columns)
    if size > _MATLAB_BYTES:
        raise SaveError(f"{element.name}: {size} bytes are more than the 2 GB that a .mat file can hold; write .h5")
    names = _matlab_fields(element)
    data: Any
    if None in names:
        data = np.column_stack(columns)
    elif len(columns) == 1:
        data = columns[0]
    else:
        data = dict(zip(names, columns, strict=True))
    struct = {
        "name": element.name,
        "unit": element.unit,
        "kind": element.kind,
        "description": element.description,
        "divider": float(element.divider),
        "looping": bool(element.buffer_type.name == "LOOPING"),
        "entries": np.array([entry.name for entry in element.entries], dtype=object),
        "first": float(element.first + 1),
        "lost": float(element.lost),
        "failed": float(element.failures.count),
        "failed_ticks": np.array(element.failures.spans, np.int64).reshape(-1, 2),
        "time": _seconds(times, start),
        "data": data,
    }
    fills = _fills(written)
    if fills:
        struct["missing"] = np.array(fills, np.uint64 if fills[0] > np.iinfo(np.int64).max else np.int64)
    labels = element.entries[0].entry.labels if element.entries else None
    if labels:
        struct["label_values"] = np.array(sorted(labels), dtype=np.int64)
        struct["label_names"] = np.array([labels[number] for number in sorted(labels)], dtype=object)
    return struct


def _matlab_fields(element: RecordedElement) -> list[str | None]:
    """The field of `data` that each entry is, None for a column of it."""
    columns = [_matlab_values(entry.values[:0]) for entry in in_doubles(element).entries]
    if len({column.dtype for column in columns}) == 1 and columns[0].dtype.kind not in "OSU" and columns[0].ndim == 1:
        return [None] * len(columns)
    fields = unique_names(lambda suffix: re.sub("[^A-Za-z0-9]+", "_", suffix).strip("_") or "value", str.lower)
    names = [fields(entry.entry.suffix) for entry in element.entries]
    return [name if name[0].isalpha() else f"x{name}" for name in names]


def _variable(name: str) -> str:
    """What MATLAB may call it; it cuts longer names."""
    return (re.sub("[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed")[: _MATLAB_NAME - 6]


def _fills(entries: Sequence[RecordedEntry]) -> list[int]:
    """The numbers that stand where values are missing, of each entry that has one."""
    told = [entry.missing.fill for entry in entries if isinstance(entry, FilledEntry)]
    found = [fill for fill in told if fill is not None]
    return found[:1] if len(set(found)) == 1 else found


def _matlab_values(values: NDArray[Any]) -> NDArray[Any]:
    """Values of a type that MATLAB has: no float16, no long double, no dates."""
    dtype = values.dtype
    if dtype.kind == "f":
        with np.errstate(over="ignore", invalid="ignore"):
            return values.astype(np.float32 if dtype.itemsize < 4 else np.float64 if dtype.itemsize > 8 else dtype)
    if dtype.kind in "mM":
        return values.astype(np.int64)
    if dtype.kind == "S":
        return np.array([text.decode("utf-8", "replace") for text in values.tolist()], dtype=object)
    if dtype.kind == "U":  # as cells, too: a matrix of letters is padded with blanks
        return np.array(values.tolist(), dtype=object)
    if dtype.kind == "V":
        return np.ascontiguousarray(values).view(np.uint8).reshape(len(values), dtype.itemsize)
    return np.asarray(values)


def write_hdf5(recording: Recording, path: Path, progress: Progress = silent) -> None:
    """Write one group per element, at the element's name: `values` and `time_ns`, and attributes (unit, kind ...).

    `values` has shape (samples,) + the element's shape; an element of several types has one dataset per entry. Equal
    time stamps are stored once. Where whole numbers are missing stands the attribute `_FillValue` of the dataset, as in
    netCDF. Needs as much memory as the file is long. Raises `SaveError`, and `SiloError` without
    h5py.
    """
    recording = presentable(recording)
    h5py = need("h5py", "convert", "HDF5 files")
    # made in memory: the HDF5 library ends the process with a segmentation fault when a disk is full
    memory = io.BytesIO()
    with whole_file(path) as file:
        # as of HDF5 1.8, of 2008: before, an attribute held 64 kB, the names of 4000 entries
        with h5py.File(memory, "w", libver=("v108", "v108")) as store:
            _fill_store(h5py, store, recording, progress)
        file.write(memory.getbuffer())


def _fill_store(h5py: Any, store: Any, recording: Recording, progress: Progress) -> None:
    total = max(1, len(recording.elements))
    store.attrs["logger"] = recording.logger
    store.attrs["frequency_hz"] = np.nan if recording.frequency_hz is None else recording.frequency_hz
    store.attrs["started_ns"] = recording.started_ns
    if recording.warnings:
        texts = [text.replace("\0", "_") for text in recording.warnings]
        store.create_dataset(_free(store, "warnings"), data=texts, dtype=h5py.string_dtype())
    if recording.events:
        # a data set: an attribute holds at most 64 kB
        store.create_dataset(_free(store, "events"), data=msgspec.json.encode(recording.events).decode())
    store.create_group(NAME)  # no element takes it
    places: list[Place] = []
    own: dict[int, str] = {}
    elements = [filled(element) for element in recording.elements]
    shared = {(0, 1, len(recording.time_ns), id(None)): _checked(store, "time_ns", recording.time_ns)}
    for done, element in enumerate(elements, start=1):
        group = _group(store, element.name)
        when = (element.first, element.divider, element.count, id(element.own_ns))
        if when not in shared:
            shared[when] = _checked(group, _free(group, "time_ns"), stamps_of(recording, element))
        else:
            group[_free(group, "time_ns")] = shared[when]
        own |= {} if element.own_ns is None else {done - 1: shared[when].name}
        places += _fill_group(h5py, group, element)
        progress(done / total)
    del store[NAME]
    # of a length that is written: see `_values`
    store.create_dataset(NAME, data=np.bytes_(packed(recording, elements, places, own).encode()))


def read_hdf5(path: Path) -> Recording:
    """Open a file that `write_hdf5` wrote; a data set is read when a signal of it is asked for."""
    h5py = need("h5py", "convert", "HDF5 files")

    @lru_cache(maxsize=1)  # the entries of an element are asked for one behind the other
    def whole(name: str) -> NDArray[Any]:
        return _values(store[name])

    def column(place: Place, *_: object) -> NDArray[Any]:
        values = whole(place[0])
        return values if place[1] < 0 else values.reshape(len(values), -1)[:, place[1]]

    with told_of(path):
        store = h5py.File(path, "r")
        text = _values(store[NAME]).tobytes().rstrip(b"\0") if NAME in store else None
        return restored(path, text, lambda: int(store["time_ns"].size), lambda: _values(store["time_ns"]), column)


def _values(dataset: Any) -> NDArray[Any]:
    """What a data set holds; `FileFormatError` for values of a length of their own, which we never write.

    The HDF5 library turns for ever in a damaged heap of such values, where no signal reaches it.
    """
    if dataset.dtype.hasobject:
        raise FileFormatError(f"{dataset.name} has values of lengths of their own, which silo doesn't write there")
    return np.asarray(dataset[()])


def _group(store: Any, name: str) -> Any:
    """A group of this name; where a dataset of another element has it, a number is added."""
    parts = [part for part in name.split("/") if part not in ("", ".")] or ["unnamed"]
    group = store
    for part in parts[:-1]:
        group = _child(group, part, fresh=False)
    return _child(group, parts[-1], fresh=True)


def _child(group: Any, part: str, fresh: bool) -> Any:
    name = next(
        one
        for one in numbered(part.replace("\0", "_"))
        if one not in group or (hasattr(group[one], "create_group") and not (fresh and "kind" in group[one].attrs))
    )
    return group.require_group(name)


def _fill_group(h5py: Any, group: Any, element: RecordedElement) -> list[Place]:
    group.attrs["name"] = element.name.replace("\0", "_")
    group.attrs["unit"] = element.unit.replace("\0", "_")
    group.attrs["kind"] = element.kind
    group.attrs["divider"] = element.divider
    group.attrs["buffer"] = element.buffer_type.name
    group.attrs["lost"] = element.lost
    group.attrs["failed"] = element.failures.count
    if element.failures.spans:
        group.attrs["failed_ticks"] = np.array(element.failures.spans, np.int64)
    if element.description:
        group.attrs["description"] = element.description.replace("\0", "_")
    names = [entry.name.replace("\0", "_") for entry in element.entries]
    group.attrs.create("entries", names, dtype=h5py.string_dtype())
    labels = element.entries[0].entry.labels if element.entries else None
    if labels:
        group.attrs["labels"] = msgspec.json.encode(labels).decode()
    written = element.entries
    columns = [_hdf5_values(entry.values) for entry in written]
    if columns and len({column.dtype for column in columns}) == 1:
        values = columns[0] if len(columns) == 1 else np.column_stack(columns)
        if len(columns) > 1 and math.prod(element.shape) == len(columns):
            values = values.reshape(element.count, *element.shape)
        dataset = _checked(group, _free(group, "values"), values)
        _tell_fill(dataset, written)
        return [(dataset.name, at) for at in range(len(columns))]
    places = []
    for entry, column in zip(written, columns, strict=True):
        name = entry.entry.suffix.strip("_").replace("/", "_").replace("\0", "_") or "values"
        dataset = _checked(group, _free(group, name), column)
        _tell_fill(dataset, [entry])
        places.append((dataset.name, -1))
    return places


def _checked(group: Any, name: str, values: NDArray[Any]) -> Any:
    """A new data set, of whose bytes checksums are kept; one that is empty has none."""
    return group.create_dataset(name, data=values, fletcher32=values.size > 0 or None)


def _tell_fill(dataset: Any, entries: Sequence[RecordedEntry]) -> None:
    for fill in _fills(entries):
        dataset.attrs.create("_FillValue", fill, dtype=dataset.dtype)


def _free(group: Any, name: str) -> str:
    return next(one for one in numbered(name) if one not in group)


def _hdf5_values(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind in "mM":
        return values.astype(np.int64)
    if values.dtype.kind == "U":
        return np.char.encode(values, "utf-8")
    return np.asarray(values)


def _seconds(time_ns: NDArray[np.int64], start: int) -> NDArray[np.float64]:
    return np.asarray((time_ns - start) / 1e9)


def _facts(recording: Recording) -> str:
    elements = []
    for element in recording.elements:
        facts = _of(element, "name", "unit", "kind", "shape", "divider") | {"buffer": element.buffer_type.name}
        facts |= _of(element, "first", "description", "lost", "failures", "dtype")
        entries = [{"name": e.name, "type": e.values.dtype.str, "labels": e.entry.labels} for e in element.entries]
        elements.append({**facts, "entries": entries})
    facts = _of(recording, "logger", "frequency_hz", "started_ns", "offset") | {"elements": elements}
    return msgspec.json.encode(facts | _of(recording, "events", "warnings")).decode()


def _of(what: object, *names: str) -> dict[str, Any]:
    return {name: getattr(what, name) for name in names}
