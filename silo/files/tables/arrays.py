"""A recording -> files of arrays: NumPy's `.npz`, MATLAB's `.mat`, HDF5.

An element's samples stand together with their time stamps, so that nobody has to know silo's rules of time.
"""

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, RecordedEntry, Recording, stamps_of
from silo.errors import SaveError
from silo.files.extras import need, whole_file
from silo.files.silo.format import FilledEntry
from silo.files.silo.missing import filled, in_doubles, is_masked
from silo.files.texts import presentable

# MATLAB cuts longer names
_MATLAB_NAME = 63
_MATLAB_BYTES = 2**31 - 1


def write_npz(recording: Recording, path: Path, progress: Progress | None = None) -> None:
    """Write one array per entry under the entry's name without the leading `/`, and `time_ns` (int64).

    An element that has not exactly one sample per tick has its own `<element>.time_ns`. What arrays can't say (units,
    labels, dividers) stands in `silo.json`, a 0-d string. Where whole numbers are missing, `<entry>.missing` (bool)
    says which, and a number that no sample is stands there. Raises `SaveError`.
    """
    recording = presentable(recording)
    unique = _unique(lambda name: name.lstrip("/").replace("\0", "_") or "unnamed")
    total = max(1, len(recording.elements))
    with whole_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        _add(archive, unique("time_ns"), recording.time_ns)
        _add(archive, unique("silo.json"), np.array(_facts(recording)))
        for done, element in enumerate(recording.elements, start=1):
            for entry, written in zip(element.entries, filled(element).entries, strict=True):
                _add(archive, unique(entry.name), written.values)
                if is_masked(entry.values):
                    _add(archive, unique(f"{entry.name}.missing"), np.ma.getmaskarray(entry.values))
            if element.count != len(recording.time_ns):
                _add(archive, unique(f"{element.name}.time_ns"), _times(recording, element))
            _tell(progress, done / total)


def _add(archive: zipfile.ZipFile, name: str, values: NDArray[Any]) -> None:
    if values.dtype.hasobject:
        raise SaveError(f"{name}: Python objects can't be stored in an .npz file; leave the element out")
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)


def write_mat(recording: Recording, path: Path, progress: Progress | None = None) -> None:
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
    unique = _unique(lambda name: (re.sub("[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed")[: _MATLAB_NAME - 6])
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
        matlab.savemat(file, {unique("silo"): about}, do_compression=True, long_field_names=True, oned_as="column")
        for done, element in enumerate(recording.elements, start=1):
            struct = _matlab_struct(recording, element, start)
            name = unique(element.name)
            if name[0].isdigit() or name[0] == "_":
                name = f"x{name}"
            matlab.savemat(file, {name: struct}, do_compression=True, long_field_names=True, oned_as="column")
            _tell(progress, done / total)


def _matlab_struct(recording: Recording, element: RecordedElement, start: int) -> dict[str, Any]:
    times = _times(recording, element)
    written = in_doubles(element).entries
    columns = [_matlab_values(entry.values) for entry in written]
    size = sum(column.nbytes for column in columns)
    if size > _MATLAB_BYTES:
        raise SaveError(f"{element.name}: {size} bytes are more than the 2 GB that a .mat file can hold; write .h5")
    data: Any
    if len({column.dtype for column in columns}) == 1 and columns[0].dtype.kind not in "OSU":
        data = np.column_stack(columns)
    elif len(columns) == 1:
        data = columns[0]
    else:
        fields = _unique(lambda suffix: re.sub("[^A-Za-z0-9]+", "_", suffix).strip("_") or "value")
        names = [fields(entry.entry.suffix) for entry in element.entries]
        data = {name if name[0].isalpha() else f"x{name}": column for name, column in zip(names, columns, strict=True)}
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
    if dtype.kind == "V":
        return np.ascontiguousarray(values).view(np.uint8).reshape(len(values), dtype.itemsize)
    return np.asarray(values)


def write_hdf5(recording: Recording, path: Path, progress: Progress | None = None) -> None:
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
        with h5py.File(memory, "w") as store:
            _fill_store(h5py, store, recording, progress)
        file.write(memory.getbuffer())


def _fill_store(h5py: Any, store: Any, recording: Recording, progress: Progress | None) -> None:
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
    shared = {(0, 1, len(recording.time_ns), id(None)): store.create_dataset("time_ns", data=recording.time_ns)}
    for done, element in enumerate(recording.elements, start=1):
        group = _group(store, element.name)
        when = (element.first, element.divider, element.count, id(element.own_ns))
        if when not in shared:
            shared[when] = group.create_dataset(_free(group, "time_ns"), data=_times(recording, element))
        else:
            group[_free(group, "time_ns")] = shared[when]
        _fill_group(h5py, group, element)
        _tell(progress, done / total)


def _group(store: Any, name: str) -> Any:
    """A group of this name; where a dataset of another element has it, a number is added."""
    parts = [part for part in name.split("/") if part not in ("", ".")] or ["unnamed"]
    group = store
    for part in parts[:-1]:
        group = _child(group, part, fresh=False)
    return _child(group, parts[-1], fresh=True)


def _child(group: Any, part: str, fresh: bool) -> Any:
    part = part.replace("\0", "_")
    candidate, number = part, 2
    while candidate in group:
        child = group[candidate]
        if hasattr(child, "create_group") and not (fresh and "kind" in child.attrs):
            return child
        candidate, number = f"{part}_{number}", number + 1
    return group.create_group(candidate)


def _fill_group(h5py: Any, group: Any, element: RecordedElement) -> None:
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
    written = filled(element).entries
    columns = [_hdf5_values(entry.values) for entry in written]
    if columns and len({column.dtype for column in columns}) == 1:
        values = columns[0] if len(columns) == 1 else np.column_stack(columns)
        if len(columns) > 1 and np.prod(element.shape) == len(columns):
            values = values.reshape(element.count, *element.shape)
        _tell_fill(group.create_dataset(_free(group, "values"), data=values), written)
        return
    for entry, column in zip(written, columns, strict=True):
        name = entry.entry.suffix.strip("_").replace("/", "_").replace("\0", "_") or "values"
        _tell_fill(group.create_dataset(_free(group, name), data=column), [entry])


def _tell_fill(dataset: Any, entries: Sequence[RecordedEntry]) -> None:
    for fill in _fills(entries):
        dataset.attrs.create("_FillValue", fill, dtype=dataset.dtype)


def _free(group: Any, name: str) -> str:
    candidate, number = name, 2
    while candidate in group:
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def _hdf5_values(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind in "mM":
        return values.astype(np.int64)
    if values.dtype.kind == "U":
        return np.char.encode(values, "utf-8")
    return np.asarray(values)


def _times(recording: Recording, element: RecordedElement) -> NDArray[np.int64]:
    return stamps_of(recording, element)


def _seconds(time_ns: NDArray[np.int64], start: int) -> NDArray[np.float64]:
    return np.asarray((time_ns - start) / 1e9)


def _facts(recording: Recording) -> str:
    elements = [
        {
            "name": element.name,
            "unit": element.unit,
            "kind": element.kind,
            "shape": element.shape,
            "divider": element.divider,
            "buffer": element.buffer_type.name,
            "first": element.first,
            "description": element.description,
            "lost": element.lost,
            "failures": element.failures,
            "dtype": element.dtype,
            "entries": [
                {"name": e.name, "type": e.values.dtype.str, "labels": e.entry.labels} for e in element.entries
            ],
        }
        for element in recording.elements
    ]
    facts = {"logger": recording.logger, "frequency_hz": recording.frequency_hz, "started_ns": recording.started_ns}
    return msgspec.json.encode(
        {
            **facts,
            "offset": recording.offset,
            "elements": elements,
            "events": recording.events,
            "warnings": list(recording.warnings),
        }
    ).decode()


def _unique(clean: Callable[[str], str]) -> Callable[[str], str]:
    taken: set[str] = set()

    def choose(name: str) -> str:
        base = candidate = clean(name)
        number = 2
        # MATLAB and some file systems don't tell upper from lower case
        while candidate.lower() in taken:
            candidate, number = f"{base}_{number}", number + 1
        taken.add(candidate.lower())
        return candidate

    return choose


def _tell(progress: Progress | None, fraction: float) -> None:
    if progress is not None:
        progress(fraction)
