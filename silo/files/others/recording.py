"""A bag of others as a recording: each topic a few elements, with the time stamps at which its messages were logged.

`open_others` reads indices, and a few messages of topics with arrays; an element's values cost its topic, once for all
elements of the topic. `stamped_by_header` gives the same by the stamps in the messages' headers.
"""

import mmap
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from silo.errors import FileFormatError, LogNotFoundError, LogWarning
from silo.files.atomic import reason
from silo.files.bag_index import damage_told
from silo.files.others import cdr, json_text
from silo.files.others.mcap_file import McapFile
from silo.files.others.message_types import Message, Path, UnknownTypeError, Wanted, message_type, signals_of
from silo.files.others.sqlite_file import SqliteFile
from silo.files.others.topics import Equal, Topic
from silo.files.silo_values import file_recording
from silo.model import BufferType, Entry
from silo.recording import RecordedElement, Recording, common_axis, lazy_entry

_HEADER: Path = ("header", "stamp")
_JOINTS = "sensor_msgs/msg/JointState"
_MOST_TOLD = 5


def open_others(path: FilePath) -> Recording:
    """Open a file or folder that silo did not write.

    Raises `LogNotFoundError`, `FileFormatError` where nothing of it can be read, and `SiloError` without `rosbags`.
    """
    files = _files(path)
    with damage_told(path):
        topics: dict[str, list[tuple[FilePath, Topic]]] = {}
        for file in files:
            for topic in file.topics():
                topics.setdefault(topic.name, []).append((file.path, topic))
        unknown: list[str] = []
        left: list[str] = []
        readers: list[TopicReader] = []
        for name, parts in topics.items():
            try:
                reader = _reader(name, parts)
            except UnknownTypeError as error:
                unknown.append(f"{name} ({parts[0][1].type or 'no type'}: {error})")
                continue
            left += [f"{name}/{'/'.join(field)}" for field in reader.left]
            readers.append(reader)
        if not topics:
            cut = "; ".join(warning for file in files if isinstance(file, McapFile) for warning in file.warnings)
            raise FileFormatError(f"'{path}' is no log of silo, and holds no message{f' ({cut})' if cut else ''}")
        told = [warning for file in files if isinstance(file, McapFile) for warning in file.warnings]
        told += _told(unknown, left)
        elements = tuple(element for reader in readers for element in reader.elements())
    return file_recording(
        lambda: common_axis([reader.log_ns for reader in readers]),
        logger=path.stem,
        offset=0,
        elements=elements,
        prefix="",
        warnings=tuple(told),
    )


def stamped_by_header(recording: Recording) -> Recording:
    """Return a bag of others with the stamps of the messages' headers, where they have one; others stay as they are."""
    headed: dict[int, TopicReader] = {}
    elements: list[RecordedElement] = []
    for element in recording.elements:
        if isinstance(element, TopicElement):
            reader = headed.setdefault(id(element.reader), element.reader.by_header())
            elements.append(next(one for one in reader.elements() if one.name == element.name))
        else:
            elements.append(element)
    return replace(recording, elements=tuple(elements)) if headed else recording


def _told(unknown: Sequence[str], left: Sequence[str]) -> Iterator[str]:
    """One warning of all that is not read."""
    parts = []
    if unknown:
        parts.append(f"{len(unknown)} topics are left out: {_some(unknown)}")
    if left:
        parts.append(f"bytes and lists of messages are no signals: {_some(left)}")
    if parts:
        yield "; ".join(parts)


def _some(words: Sequence[str]) -> str:
    more = f" and {len(words) - _MOST_TOLD} more" if len(words) > _MOST_TOLD else ""
    return ", ".join(words[:_MOST_TOLD]) + more


# --------------------------------------------------------------------------------------------------------------- files


def _files(path: FilePath) -> list[McapFile | SqliteFile]:
    about: dict[str, Any] = {}
    paths = [path]
    if path.is_dir():
        about = _metadata(path)
        paths = [path / FilePath(str(name)).name for name in about.get("relative_file_paths") or ()]
        paths = [one for one in paths if one.exists()] or sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
    packed = [one for one in paths if one.suffix == ".zstd"] or sorted(path.glob("*.zstd"))
    if packed and (not paths or packed[0] in paths):
        raise FileFormatError(f"'{path}' is compressed as a whole: unpack it by `zstd -d {packed[0].name}` there")
    if not paths:
        raise FileFormatError(f"'{path}' is a folder without a bag in it: there is neither an .mcap nor a .db3 file")
    mode = str(about.get("compression_mode") or "").lower()
    return [_file(one, packed=mode == "message") for one in paths]


def _file(path: FilePath, *, packed: bool) -> McapFile | SqliteFile:
    if path.suffix == ".db3":
        return SqliteFile(path, packed=packed)
    try:
        with path.open("rb") as opened, damage_told(path):
            data = memoryview(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
            return McapFile(path, data)
    except OSError as error:
        raise LogNotFoundError(f"can't open '{path}': {reason(error)}") from error


def _metadata(folder: FilePath) -> dict[str, Any]:
    try:
        found = yaml.safe_load((folder / "metadata.yaml").read_text("utf-8"))
    except (OSError, ValueError, yaml.YAMLError):
        return {}  # the files say as much
    about = found.get("rosbag2_bagfile_information") if isinstance(found, dict) else None
    return about if isinstance(about, dict) else {}


# -------------------------------------------------------------------------------------------------------------- topics


def _reader(name: str, parts: Sequence[tuple[FilePath, Topic]]) -> "TopicReader":
    """Raises `UnknownTypeError` for a topic that can't be read."""
    path, first = parts[0]
    alike = [topic for _, topic in parts if (topic.type, topic.encoding) == (first.type, first.encoding)]
    if first.encoding == "json":
        wanted, left = json_text.signals_of(_looked_at(alike))
        return TopicReader(name, path, alike, None, wanted, left)
    if first.encoding != "cdr":
        raise UnknownTypeError(f"silo reads no {first.encoding or 'unnamed'} messages")
    if first.definition and first.language not in ("ros2msg", "ros2idl", ""):
        raise UnknownTypeError(f"silo reads no definitions in {first.language}")
    message = message_type(first.type, first.definition, first.language)
    wanted, left = signals_of(message)
    endless = [one.name for one in wanted if one.count < 0]
    some = _looked_at(alike) if endless else []
    joints = _joints(message, some) if first.type == _JOINTS else ()
    lengths = cdr.lengths_of(message, endless, some) if endless else {}
    kept: list[Wanted] = []
    empty: list[Path] = []
    for one in wanted:
        count = lengths.get(one.name, one.count)
        if count > cdr.MOST_VALUES:
            left.append(one.name)
        elif one.count < 0 and not count:
            empty.append(one.name)
        elif one.count < 0:
            named = joints and one.name in (("position",), ("velocity",), ("effort",))
            suffixes = [f"_{joint}" for joint in joints] if named else [f"_{at}" for at in range(count)]
            kept.append(replace(one, suffixes=tuple(suffixes), count=len(suffixes)))
        else:
            kept.append(one)
    return TopicReader(name, path, alike, message, kept, left, joints, empty)


def _looked_at(parts: Sequence[Topic]) -> list[Equal]:
    """A few messages of a topic, numbered through all files in the order in which they stand there."""
    found: list[Equal] = []
    for topic in parts:
        total = 1 + max((int(which.max()) for which, _ in found), default=-1)
        found += [(which + total, rows) for which, rows in topic.stored.some()]
    return found


def _joints(message: Message, some: Sequence[Equal]) -> tuple[str, ...]:
    """The names of joints in some messages, in the order in which they come."""
    found: dict[bytes, None] = {}
    most = cdr.lengths_of(message, [("name",)], some)[("name",)]
    if most:
        total = 1 + max(int(which.max()) for which, _ in some)
        names = cdr.columns_of(message, {("name",): most}, some, total)[("name",)]
        found = dict.fromkeys(names.ravel().tolist())
    return tuple(name.decode("utf-8", "backslashreplace") for name in found if name)


class TopicReader:
    """The messages of a topic in all files of a bag, in the order of time; read when they are first asked for."""

    def __init__(
        self,
        name: str,
        path: FilePath,
        parts: Sequence[Topic],
        message: Message | None,
        wanted: Sequence[Wanted],
        left: Sequence[Path],
        joints: Sequence[str] = (),
        empty: Sequence[Path] = (),  # arrays without a value in all messages that were looked at
        headed: "TopicReader | None" = None,
    ) -> None:
        self.name = name
        self.path = path
        self.left = left
        self._parts = parts
        self._message = message
        self._wanted = wanted
        self._joints = joints
        self._empty = empty
        self._read = headed  # whose columns these are, in another order

    def by_header(self) -> "TopicReader":
        """Return the same with the stamps of the headers."""
        if not any(one.name == _HEADER for one in self._wanted):
            return self
        return TopicReader(
            self.name, self.path, self._parts, self._message, self._wanted, self.left, self._joints, headed=self
        )

    def elements(self) -> "list[TopicElement]":
        """Return the elements; their values and stamps are read when they are asked for."""
        return [self._element(one) for one in self._wanted]

    def _element(self, one: Wanted) -> "TopicElement":
        name = "/".join((self.name, *one.name))
        several = len(one.suffixes) > 1 or one.count > 0
        entries = []
        for place, suffix in enumerate(one.suffixes):
            if len(one.paths) > 1:
                shown, path, at = "/".join((self.name, *one.paths[place])), one.paths[place], None
            else:
                shown, path, at = name + suffix, one.paths[0], place if several else None
            dtype = np.dtype(one.dtype).str if one.dtype != "S" else "|S"
            entry = Entry(suffix, dtype, dict(one.labels) or None)
            entries.append(lazy_entry(shown, entry, _Column(self, path, at)))
        made = TopicElement(
            name=name,
            unit=one.unit,
            kind=one.kind,
            shape=(len(one.suffixes),) if several else (),
            divider=1,
            buffer_type=BufferType.GROWING,
            first=0,
            entries=tuple(entries),
        )
        made.__dict__.pop("own_ns")
        made.__dict__["reader"] = self
        return made

    @cached_property
    def _logged(self) -> tuple[NDArray[np.int64], NDArray[np.int64] | None]:
        """The log times in order, and which message of the files each is; None where they stand in order there."""
        with damage_told(self.path):
            found = [part.stored.stamps() for part in self._parts]
        stamps = np.concatenate([np.empty(0, np.int64), *found])
        if len(stamps) < 2 or bool((stamps[1:] >= stamps[:-1]).all()):
            return stamps, None
        order = np.argsort(stamps, kind="stable")
        return stamps[order], order

    @property
    def log_ns(self) -> NDArray[np.int64]:
        """Shape `(m,)`: when the messages were logged, rising."""
        return self._read.log_ns if self._read is not None else self._logged[0]

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Shape `(m,)`: the time stamps of the elements, rising."""
        return self.log_ns if self._read is None else self._headed[0]

    @cached_property
    def _headed(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The stamps of the headers in order, and which message each is of. One that was not set is the log time."""
        assert self._read is not None
        stamps = self._read.values(_HEADER).view(np.int64)
        stamps = np.where(stamps == 0, self.log_ns, stamps)
        order = np.argsort(stamps, kind="stable")
        return stamps[order], order

    def values(self, path: Path) -> NDArray[Any]:
        """Return the values at a path, in the order of `time_ns`."""
        return self._columns[path] if self._read is None else self._read.values(path)[self._headed[1]]

    @cached_property
    def _columns(self) -> Mapping[Path, NDArray[Any]]:
        total = len(self.log_ns)
        with damage_told(self.path):
            if self._message is None:
                found = json_text.columns_of(self._wanted, self._messages(), total)
            else:
                paths = {path: one.count for one in self._wanted for path in one.paths}
                longer: set[Path] = set()
                looked = paths | dict.fromkeys(self._empty, 0)
                every = cdr.columns_of(self._message, looked, self._messages(), total, longer)
                found = {path: every[path] for path in paths}
                if longer and not self._joints:
                    words = _some([f"{self.name}/{'/'.join(path)}" for path in sorted(longer)])
                    self._warn(f"arrays that are longer in some messages are cut to their usual length: {words}")
        return self._by_joint(found) if self._joints else found

    def _warn(self, what: str) -> None:
        warnings.warn(f"{self.path}: {what}", LogWarning, stacklevel=2)

    def _messages(self) -> Iterator[Equal]:
        order = self._logged[1]
        rank = None
        if order is not None:
            rank = np.empty(len(order), np.int64)
            rank[order] = np.arange(len(order))
        first = 0
        for part in self._parts:
            count = 0
            for which, rows in part.stored.messages():
                places = which + first
                count += len(which)
                yield places if rank is None else rank[places], rows
            first += count

    def _by_joint(self, found: dict[Path, NDArray[Any]]) -> dict[Path, NDArray[Any]]:
        """Values of joints under the names that each message gives them: publishers take turns on this topic."""
        names = found[("name",)]
        if not (names == names[0]).all() or tuple(names[0]) != tuple(joint.encode() for joint in self._joints):
            columns = {joint.encode(): at for at, joint in enumerate(self._joints)}
            rows, alike = np.unique(names, axis=0, return_inverse=True)
            unseen = sorted({name.decode("utf-8", "replace") for name in rows.ravel().tolist()} - {"", *self._joints})
            if unseen:
                self._warn(f"joints of {self.name} that come in late are left out: {_some(unseen)}")
            for path in (("position",), ("velocity",), ("effort",)):
                if path not in found:
                    continue
                made = np.full((len(names), len(self._joints)), np.nan)
                for number, row in enumerate(rows):
                    mine = np.flatnonzero(alike.ravel() == number)
                    pairs = [(at, columns[name]) for at, name in enumerate(row.tolist()) if name in columns]
                    pairs = [(at, to) for at, to in pairs if at < found[path].shape[1]]
                    if pairs:
                        source, target = (list(each) for each in zip(*pairs, strict=True))
                        made[np.ix_(mine, target)] = found[path][np.ix_(mine, source)]
                found[path] = made
        return found


class _Column:
    """Reads one scalar of a topic."""

    def __init__(self, reader: TopicReader, path: Path, at: int | None) -> None:
        self._reader, self._path, self._at = reader, path, at

    def __call__(self) -> NDArray[Any]:
        values = self._reader.values(self._path)
        return values if self._at is None else values[:, self._at]


class TopicElement(RecordedElement):
    """An element of a topic: its stamps are read when they are first asked for."""

    reader: TopicReader

    @cached_property
    def own_ns(self) -> NDArray[np.int64]:
        """Shape `(count,)`: time stamps, ns."""
        return self.reader.time_ns
