"""A bag of others as a recording: each topic a few elements, with the time stamps at which its messages were logged.

`open_others` reads indices, a few messages of each topic, and all of JSON; an element's values cost its topic, once for
all elements of the topic. `stamped_by_header` gives the same by the stamps in the messages' headers.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path as FilePath
from typing import Any, TypeAlias

import numpy as np
import yaml
from numpy.typing import NDArray

from silo.core.elements import BufferType, Entry
from silo.core.quantities.writing import and_more, many
from silo.core.recording import DamageNotes, RecordedElement, Recording, common_axis, lazy_entry
from silo.core.yaml_depth import ShallowLoader
from silo.errors import FileFormatError, LogNotFoundError, reason
from silo.files.formats import ROS1_MARK, refuse_others, starts_with
from silo.files.mcap.chunks import mapped
from silo.files.mcap.damage import damage_told
from silo.files.others import cdr, json_text
from silo.files.others.keyed import KeyedList, KeyedValues, keyed_list, of_keys
from silo.files.others.mcap_file import McapFile
from silo.files.others.message_types import (
    MOST_VALUES,
    FieldSpec,
    MessageFields,
    Path,
    UnknownTypeError,
    message_type,
    signals_of,
)
from silo.files.others.ros1_file import RosbagFile
from silo.files.others.sqlite_file import SqliteFile
from silo.files.others.topics import SOME, Bad, Equal, FileTopic, Unpacked
from silo.files.silo.values import file_recording

_HEADER: Path = ("header", "stamp")
_JOINTS = "sensor_msgs/msg/JointState"
_MOST_TOLD = 5
_MOST_LOOKED_AT = 100_000  # messages of a list with keys
_File: TypeAlias = McapFile | SqliteFile | RosbagFile


def open_others(path: FilePath) -> Recording:
    """Open a file or folder that silo did not write.

    Raises `LogNotFoundError`, `FileFormatError` where nothing of it can be read, and `SiloError` without `rosbags`.
    """
    told = DamageNotes(path)
    with damage_told(path):
        topics: dict[str, list[tuple[FilePath, FileTopic]]] = {}
        for file, packed in _files(path, told):
            for topic in file.topics():
                one = replace(topic, stored=Unpacked(topic.stored)) if packed else topic
                topics.setdefault(topic.name, []).append((file.path, one))
        if not topics:
            raise FileFormatError(f"'{path}' is no log of silo, and holds no message{_because(told)}")
        unknown: dict[str, str] = {}
        damaged: list[str] = []
        left: list[str] = []
        readers: list[TopicReader] = []
        for name, parts in topics.items():
            for called, those in _by_schema(name, parts, unknown, told):
                try:
                    reader = _reader(called, those, told)
                except UnknownTypeError as error:
                    unknown[called] = f"{those.parts[0][1].type or 'no type'}: {error}"
                    damaged += [called] if isinstance(error, DamagedTopicError) else []
                    continue
                left += [f"{called}/{'/'.join(field)}" for field in reader.left]
                readers.append(reader)
        if not readers and damaged:
            why = f"{_some(_named(unknown))}{_because(told)}"
            raise FileFormatError(f"{path}: damaged, nothing in it can be read: {why}")
        lacks = [f"{many(len(unknown), 'topic')} left out: {_some(_named(unknown))}"] if unknown else []
        lacks += [f"bytes, lists of messages and of lists are no signals: {_some(left)}"] if left else []
        if lacks:
            told.add("; ".join(lacks))
        elements = tuple(element for reader in readers for element in reader.elements())
    told.loud = True
    return file_recording(
        lambda: common_axis([reader.log_ns for reader in readers]),
        logger=path.stem,
        offset=0,
        elements=elements,
        prefix="",
        warnings=told,
    )


def _because(told: Sequence[str]) -> str:
    return f" ({'; '.join(told[:_MOST_TOLD])})" if told else ""


def _named(unknown: Mapping[str, str]) -> list[str]:
    return [f"{name} ({why})" for name, why in unknown.items()]


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


_some = partial(and_more, most=_MOST_TOLD)


# --------------------------------------------------------------------------------------------------------------- files


def _files(path: FilePath, told: DamageNotes) -> list[tuple[_File, bool]]:
    """The files of a bag, and of each whether its messages are compressed one by one."""
    about: dict[str, Any] = {}
    paths = [path]
    if path.is_dir():
        about = _metadata(path, told)
        paths = [path / FilePath(str(name)).name for name in about.get("relative_file_paths") or ()]
        paths = [one for one in paths if one.exists()] or sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
    packed = [one for one in paths if one.suffix == ".zstd"] or sorted(path.glob("*.zstd"))
    if packed and (not paths or packed[0] in paths):
        raise FileFormatError(f"'{path}' is compressed as a whole: unpack it by `zstd -d {packed[0].name}` there")
    if not paths:
        raise FileFormatError(f"'{path}' is a folder without a bag in it: there is neither an .mcap nor a .db3 file")
    by_message = str(about.get("compression_mode") or "").lower() == "message"
    found: list[tuple[_File, bool]] = []
    for one in paths:
        try:
            file = _file(one, told)
        except FileFormatError as error:
            if len(paths) == 1:
                raise
            told.add(f"'{one.name}' can't be read, the other files of the bag are: {error}")
            continue
        found.append((file, by_message))
    return found


def _file(path: FilePath, told: DamageNotes) -> _File:
    refuse_others(path)
    if starts_with(path, ROS1_MARK):
        return RosbagFile(path)
    if path.suffix == ".db3":
        return SqliteFile(path)
    try:
        with path.open("rb") as opened, damage_told(path):
            return McapFile(path, mapped(opened), told)
    except OSError as error:
        raise LogNotFoundError(f"can't open '{path}': {reason(error)}") from error


def _metadata(folder: FilePath, told: DamageNotes) -> dict[str, Any]:
    try:
        refuse_others(folder / "metadata.yaml")
        found = yaml.load((folder / "metadata.yaml").read_text("utf-8"), ShallowLoader)
    except FileFormatError as error:
        told.add(f"{error}; which files there are, and whether their messages are compressed, is not known without it")
        return {}
    except (OSError, ValueError, yaml.YAMLError):
        return {}  # the files say as much
    about = found.get("rosbag2_bagfile_information") if isinstance(found, dict) else None
    return about if isinstance(about, dict) else {}


# -------------------------------------------------------------------------------------------------------------- topics


class DamagedTopicError(UnknownTypeError):
    """Not one message of a topic can be read."""


@dataclass(frozen=True)
class _Alike:
    """Messages of a topic that are of one schema, in all files; `message` is their type, None of JSON."""

    parts: list[tuple[FilePath, FileTopic]]
    message: MessageFields | None


def _by_schema(
    name: str, parts: Sequence[tuple[FilePath, FileTopic]], unknown: dict[str, str], told: DamageNotes
) -> list[tuple[str, _Alike]]:
    """What a topic has messages of, under the names that they get: one by itself is called as the topic.

    `unknown` gets what can't be read, `told` that there are several.
    """
    found: list[_Alike] = []
    refused: dict[str, str] = {}
    types: dict[tuple[str, ...], MessageFields | None] = {}
    for path, topic in parts:
        key = (topic.type, topic.definition, topic.language, topic.encoding)
        try:
            if key not in types:
                types[key] = _type_of(topic)
        except UnknownTypeError as error:
            refused.setdefault(topic.type, f"{topic.type or 'no type'}: {error}")
            continue
        message = types[key]
        one = next((one for one in found if one.message == message), None)
        if one is None:
            found.append(one := _Alike([], message))
        one.parts.append((path, topic))
    named = [(name if not at else f"{name}#{at + 1}", one) for at, one in enumerate(found)]
    if len(named) > 1:
        words = ", ".join(f"{called} ({one.parts[0][1].type})" for called, one in named)
        told.add(f"{name} has messages of {len(named)} types, which are topics of their own: {words}")
    for at, why in enumerate(refused.values()):
        unknown[name if not found and not at else f"{name}#{len(found) + at + 1}"] = why
    return named


def _type_of(topic: FileTopic) -> MessageFields | None:
    """The type of a topic's messages, None of JSON. Raises `UnknownTypeError`."""
    if topic.encoding == "json":
        return None
    if topic.encoding != "cdr":
        raise UnknownTypeError(f"silo reads no {topic.encoding or 'unnamed'} messages")
    if topic.definition and topic.language not in ("ros2msg", "ros2idl", ""):
        raise UnknownTypeError(f"silo reads no definitions in {topic.language}")
    return message_type(topic.type, topic.definition, topic.language)


def _reader(name: str, alike: _Alike, told: DamageNotes) -> "TopicReader":
    """Raises `UnknownTypeError` for a topic that can't be read."""
    path, message = alike.parts[0][0], alike.message
    parts = [topic for _, topic in alike.parts]
    if message is None:
        bad: Bad = []
        wanted, left, odd = json_text.signals_of(_every(parts, bad), bad)
        if bad and not wanted:
            raise DamagedTopicError(f"{len(bad):,} messages, of which none can be read: {bad[0][1]}")
        for text in odd:
            told.add(f"{name}{text}")
        return TopicReader(name, path, parts, None, wanted, left, told)
    wanted, left = signals_of(message)
    endless = [one.name for one in wanted if one.count < 0]
    some = _looked_at(parts, message, all_blocks=bool(endless))
    joints = _joints(message, some) if message.name == _JOINTS else ()
    lengths = cdr.lengths_of(message, endless, some, []) if endless else {}
    kept: list[FieldSpec] = []
    empty: list[Path] = []
    for one in wanted:
        count = lengths.get(one.name, one.count)
        if count > MOST_VALUES:
            left.append(one.name)
        elif one.count < 0 and not count:
            empty.append(one.name)
        elif one.count < 0:
            named = joints and one.name in (("position",), ("velocity",), ("effort",))
            suffixes = [f"_{joint}" for joint in joints] if named else [f"_{at}" for at in range(count)]
            kept.append(replace(one, suffixes=tuple(suffixes), count=len(suffixes)))
        else:
            kept.append(one)
    kind = keyed_list(message)
    left = left if kind is None else [one for one in left if one not in kind.lists]
    return TopicReader(name, path, parts, message, kept, left, told, joints, empty, kind)


def _looked_at(parts: Sequence[FileTopic], message: MessageFields, *, all_blocks: bool) -> list[Equal]:
    """A few messages of a topic, numbered through all files in the order in which they stand there.

    Of all of them, if those can't be read. Raises `DamagedTopicError` where none can.
    """
    bad: Bad = []
    found: list[Equal] = []
    for topic in parts:
        total = 1 + max((int(which.max()) for which, _ in found), default=-1)
        for which, rows in topic.stored.messages(bad, SOME):
            found.append((which + total, rows))
            if not all_blocks and cdr.any_whole(message, found, bad):
                return found
    if cdr.any_whole(message, found, bad):
        return found
    every = list(_every(parts, bad))
    if not cdr.any_whole(message, every, bad) and bad:
        total = sum(len(topic.stored.stamps()) for topic in parts)
        raise DamagedTopicError(f"{total:,} messages, of which none can be read: {bad[-1][1]}")
    return every


def _every(parts: Sequence[FileTopic], bad: Bad) -> Iterator[Equal]:
    """All messages of a topic, numbered through all files."""
    first = 0
    for part in parts:
        wrong: Bad = []
        for which, rows in part.stored.messages(wrong):
            yield which + first, rows
        bad += [(which + first, why) for which, why in wrong]
        first += len(part.stored.stamps())


def _joints(message: MessageFields, some: Sequence[Equal]) -> tuple[str, ...]:
    """The names of joints in some messages, in the order in which they come."""
    found: dict[bytes, None] = {}
    most = cdr.lengths_of(message, [("name",)], some, [])[("name",)]
    if most:
        total = 1 + max(int(which.max()) for which, _ in some)
        wanted = cdr.WantedColumns({("name",): most}, {("name",): "S"}, total, [])
        found = dict.fromkeys(cdr.columns_of(message, wanted, some)[("name",)].ravel().tolist())
    return tuple(name.decode("utf-8", "backslashreplace") for name in found if name)


@dataclass(eq=False)
class TopicReader:
    """The messages of a topic in all files of a bag, in the order of time; read when they are first asked for."""

    name: str
    path: FilePath
    _parts: Sequence[FileTopic]
    _message: MessageFields | None
    _wanted: Sequence[FieldSpec]
    left: Sequence[Path]
    _told: DamageNotes
    _joints: Sequence[str] = ()
    _empty: Sequence[Path] = ()  # arrays without a value in all messages that were looked at
    _kind: KeyedList | None = None
    _read: "TopicReader | None" = None  # whose columns these are, in another order

    def by_header(self) -> "TopicReader":
        """Return the same with the stamps of the headers."""
        if self._read is not None or not self.is_headed:
            return self
        made = copy(self)
        made._read = self
        return made

    @property
    def is_headed(self) -> bool:
        """Whether its messages say when they were measured."""
        return any(one.name == _HEADER for one in self._wanted)

    def elements(self) -> "list[TopicElement]":
        """Return the elements; their values and stamps are read when they are asked for.

        Of a list with keys the keys stand in the messages: then all of them are read here, or some of very many.
        """
        plain = [self._element(one) for one in self._wanted]
        if self._kind is None:
            return plain
        keys = self.keyed if len(self.log_ns) <= _MOST_LOOKED_AT else self._some_keys()
        readers = [KeyedListReader(self, key, found.specs(self._kind)) for key, found in keys.items()]
        return plain + [element for one in readers for element in one.elements()]

    @cached_property
    def keyed(self) -> dict[str, KeyedValues]:
        """What came under each key of a list of messages."""
        assert self._message is not None
        assert self._kind is not None
        bad: Bad = []
        with damage_told(self.path):
            found = of_keys(self._message, self._kind, self._messages(bad), bad)
        self._tell_bad(bad, len(self.log_ns))
        return found

    def _some_keys(self) -> dict[str, KeyedValues]:
        assert self._message is not None
        assert self._kind is not None
        self._told.add(f"{self.name}: what came first in it is listed, as it has {len(self.log_ns):,} messages")
        return of_keys(self._message, self._kind, _looked_at(self._parts, self._message, all_blocks=True), [])

    def _element(self, one: FieldSpec) -> "TopicElement":
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
            entries.append(
                lazy_entry(shown, entry, partial(self._column, path, at), np.dtype(dtype), lambda: len(self.time_ns))
            )
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

    def _column(self, path: Path, at: int | None) -> NDArray[Any]:
        values = self.values(path)
        return values if at is None else values[:, at]

    @cached_property
    def _logged(self) -> tuple[NDArray[np.int64], NDArray[np.int64] | None]:
        """The log times in order, and which message of the files each is; None where they stand in order there."""
        with damage_told(self.path):
            found = [part.stored.stamps() for part in self._parts]
        stamps = np.concatenate([np.empty(0, np.int64), *found])
        for part in self._parts:
            if part.stored.damage:
                self._told.add(f"{self.name}: {part.stored.damage}")
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
        measured = self._read.values(_HEADER)
        stamps = measured.view(np.int64)
        stamps = np.where(np.isnat(measured) | (stamps == 0), self.log_ns, stamps)
        order = np.argsort(stamps, kind="stable")
        return stamps[order], order

    def values(self, path: Path) -> NDArray[Any]:
        """Return the values at a path, in the order of `time_ns`."""
        return self._columns[path] if self._read is None else self._read.values(path)[self._headed[1]]

    @cached_property
    def _columns(self) -> Mapping[Path, NDArray[Any]]:
        total = len(self.log_ns)
        bad: Bad = []
        with damage_told(self.path):
            if self._message is None:
                found = json_text.columns_of(self._wanted, self._messages(bad), total, bad)
            else:
                paths = {path: one.count for one in self._wanted for path in one.paths}
                dtypes = {path: one.dtype for one in self._wanted for path in one.paths}
                looked = paths | dict.fromkeys(self._empty, 0)
                wanted = cdr.WantedColumns(looked, dtypes, total, bad)
                every = cdr.columns_of(self._message, wanted, self._messages(bad))
                found = {path: every[path] for path in paths}
                if wanted.longer and not self._joints:
                    longer = {path: f" ({more})" for path, more in wanted.longer.items()}
                    self._tell("arrays that are longer in some messages are cut to their usual length", longer)
                if wanted.cut:
                    self._tell("texts that are very long in some messages are cut", dict.fromkeys(wanted.cut, ""))
        self._tell_bad(bad, total)
        return self._by_joint(found) if self._joints else found

    def _tell(self, what: str, paths: Mapping[Path, str]) -> None:
        self._told.add(f"{what}: {_some([f'{self.name}/' + '/'.join(path) + paths[path] for path in sorted(paths)])}")

    def _tell_bad(self, bad: Bad, total: int) -> None:
        """Say of messages that can't be read which they are, when they were logged, and why."""
        reasons: dict[str, list[NDArray[np.int64]]] = {}
        for which, why in bad:
            reasons.setdefault(why if len(reasons) < _MOST_TOLD else next(iter(reasons)), []).append(which)
        for why, parts in reasons.items():
            which = np.unique(np.concatenate(parts))
            which = which[which < total]
            if not len(which):
                continue
            first, last = (str(np.datetime64(int(self.log_ns[at]), "ns")) for at in (which[0], which[-1]))
            moment = f"number {which[0]:,} (from 0), logged at {first} UTC"
            if len(which) > 1:
                moment = f"numbers {which[0]:,} to {which[-1]:,} (from 0), logged from {first} to {last} UTC"
            self._told.add(f"{self.name}: {len(which):,} of {total:,} messages can't be read, {moment}: {why}")

    def _messages(self, bad: Bad) -> Iterator[Equal]:
        """All messages, by their places in the order of time; `bad` gets the places of those that can't be read."""
        order = self._logged[1]
        places = np.arange(len(self._logged[0]))
        if order is not None:
            places[order] = np.arange(len(order))
        wrong: Bad = []
        for which, rows in _every(self._parts, wrong):
            yield places[which], rows
        bad += [(places[which], why) for which, why in wrong]

    def _by_joint(self, found: dict[Path, NDArray[Any]]) -> dict[Path, NDArray[Any]]:
        """Values of joints under the names that each message gives them: publishers take turns on this topic."""
        names = found[("name",)]
        if not (names == names[0]).all() or tuple(names[0]) != tuple(joint.encode() for joint in self._joints):
            columns = {joint.encode(): at for at, joint in enumerate(self._joints)}
            rows, alike = np.unique(names, axis=0, return_inverse=True)
            unseen = sorted({name.decode("utf-8", "replace") for name in rows.ravel().tolist()} - {"", *self._joints})
            if unseen:
                self._told.add(f"joints of {self.name} that come in late are left out: {_some(unseen)}")
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


class KeyedListReader(TopicReader):
    """What came under one key of a list of messages."""

    def __init__(self, topic: TopicReader, key: str, specs: Sequence[FieldSpec]) -> None:
        super().__init__(f"{topic.name}/{key}", topic.path, (), None, specs, (), topic._told)
        self._topic, self._key = topic, key

    @property
    def is_headed(self) -> bool:
        """Whether its messages say when they were measured."""
        return super().is_headed or self._topic.is_headed

    @property
    def log_ns(self) -> NDArray[np.int64]:
        """Shape `(m,)`: when they were logged, rising."""
        return self._topic.log_ns[self._topic.keyed[self._key].which]

    @cached_property
    def _columns(self) -> Mapping[Path, NDArray[Any]]:
        found = self._topic.keyed[self._key]
        if _HEADER in found.columns or not self._topic.is_headed:
            return found.columns
        return {**found.columns, _HEADER: self._topic.values(_HEADER)[found.which]}


class TopicElement(RecordedElement):
    """An element of a topic: its stamps are read when they are first asked for."""

    reader: TopicReader

    @cached_property
    def own_ns(self) -> NDArray[np.int64]:
        """Shape `(count,)`: time stamps, ns."""
        return self.reader.time_ns
