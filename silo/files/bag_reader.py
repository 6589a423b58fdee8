"""Reading bags that silo wrote, back into a `Recording` with every value bit for bit.

The facts attachment says where in which message each value stands; the message index says where in a chunk each
message stands; so a chunk is read with one indexed load per channel, and `open_bag` reads only what is asked for
(`silo.files.bags.index`). A file that was cut off gives what is whole, with a warning. Bags of others have no facts:
`open_bag` gives them to `silo.files.others`.
"""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.core.recording import DamageNotes, Recording, are_samples_of
from silo.core.structs import alike
from silo.errors import FileFormatError, LogNotFoundError, SiloError, reason
from silo.files.bags.index import BagElements, lost_chunk
from silo.files.bags.metadata import (
    FACTS_ATTACHMENT,
    FACTS_VERSION,
    TIME_ATTACHMENT,
    PlacedElement,
    RecordingFacts,
    unpack_facts,
    unpack_times,
)
from silo.files.formats import ROS1_MARK, refuse_others, starts_with
from silo.files.mcap.chunks import mapped, unpack_chunk
from silo.files.mcap.damage import DAMAGE, damage_told, told_damage
from silo.files.mcap.index import Index, attachment, read_index, record_at, walked_index
from silo.files.mcap.writer import MAGIC
from silo.files.parts.metadata import PART_ATTACHMENT, unpack_part
from silo.files.parts.reader import open_part


def open_bag(path: str | os.PathLike[str], *, check: bool = False) -> Recording:
    """The recording in a rosbag2 folder or an `.mcap` file; each element is read when it is asked for.

    With `check` the chunks of a part of a recording are held against their checksums and their indexes. A file that was
    cut off gives the samples that are whole; `Recording.warnings` says what is missing. Raises `LogNotFoundError` if it
    can't be opened, `FileFormatError` for damaged files.
    """
    source = Path(path)
    if _is_of_others(source):
        return _opened_others(source)
    file, data = _mapped(path)
    with damage_told(file):
        try:
            found = _opened(file, data, check)
        except _LostFactsError as error:
            return _as_of_others(source, error)
    return found or _opened_others(source)


def damage_of_bag(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """What is damaged in a bag that silo saved, its chunks too: all of it is read. Of others, and of parts of
    recordings, nothing. Raises as `open_bag` does.
    """
    if _is_of_others(Path(path)):
        return ()
    file, data = _mapped(path)
    with damage_told(file):
        try:
            found = _opened(file, data)
        except _LostFactsError as error:
            return (f"what silo wrote beside the messages can't be read ({error})",)
        if found is None or not isinstance(found.warnings, DamageNotes) or _is_part(found):
            return ()
        told = [_wrong_chunk(data, chunk.at) for chunk in (read_index(data) or _walked(data)).chunks]
        return (*found.warnings[found.warnings.stored :], *filter(None, told))


def _wrong_chunk(data: memoryview, at: int) -> str:
    try:
        unpack_chunk(record_at(data, at, Opcode.CHUNK))
    except DAMAGE as error:
        return lost_chunk(at, error)
    return ""


def _as_of_others(source: Path, error: ValueError) -> Recording:
    """A bag of silo without what it says of itself: its messages have a description of their own.

    Raises the error where they can't be read either.
    """
    try:
        found = _opened_others(source)
    except SiloError:
        raise error from None
    lost = f"what silo wrote beside the messages can't be read ({error}): read as a bag of others, each topic by itself"
    if isinstance(found.warnings, DamageNotes):
        found.warnings.insert(0, lost)
    return found


def _is_part(recording: Recording) -> bool:
    return recording.stretch is not None and bool(recording.stretch.recorder)


def _is_of_others(path: Path) -> bool:
    """Whether the files alone tell that silo did not write it: it writes one .mcap file."""
    if path.is_dir():
        return len(list(path.glob("*.mcap"))) != 1
    return path.suffix == ".db3" or starts_with(path, ROS1_MARK)


def _opened_others(path: Path) -> Recording:
    from silo.files.others.recording import open_others

    return open_others(path)


def _mapped(path: str | os.PathLike[str]) -> tuple[Path, memoryview]:
    source = Path(path)
    if not source.exists():
        raise LogNotFoundError(f"there is no file or folder '{source}'")
    file = next(source.glob("*.mcap"), source) if source.is_dir() else source
    refuse_others(file)
    try:
        with file.open("rb") as opened:
            data = mapped(opened)
    except OSError as error:
        raise LogNotFoundError(f"can't open '{file}': {reason(error)}") from error
    if not data:
        raise FileFormatError(f"{file}: the file is empty")
    return file, data


def _opened(file: Path, data: memoryview, check: bool = False) -> Recording | None:
    """What silo wrote; None of others."""
    if bytes(data[: len(MAGIC)]) != MAGIC:
        raise ValueError("not an MCAP file: it doesn't start with the MCAP mark")
    index = read_index(data) or _walked(data)
    if PART_ATTACHMENT in index.attachments:
        return open_part(file, data, index, _attached(data, index, PART_ATTACHMENT, unpack_part), check)
    if FACTS_ATTACHMENT not in index.attachments:
        return None
    facts: RecordingFacts = _attached(data, index, FACTS_ATTACHMENT, partial(unpack_facts, RecordingFacts))
    if facts.version != FACTS_VERSION:
        raise ValueError(f"layout version {facts.version} is newer than this silo reads ({FACTS_VERSION})")
    if TIME_ATTACHMENT not in index.attachments:
        raise ValueError("cut off before its time stamps")
    times: NDArray[np.int64] = _attached(data, index, TIME_ATTACHMENT, unpack_times)
    _check(facts, len(times))
    missing, stored = 0, len(facts.warnings)
    if any(_missing(element, index) for element in facts.elements):
        index = _walked(data)
        missing = sum(max(0, _missing(element, index)) for element in facts.elements)
        facts = _cut(facts, index, missing)
    elif not index.complete:
        cut = "the file is cut off: its index is missing, which other readers need; all samples are there"
        facts = msgspec.structs.replace(facts, warnings=(*facts.warnings, cut))
    bag = BagElements(file, data, facts, index, len(times))
    bag.warnings.stored = stored
    return alike(Recording, facts, time_ns=times, elements=bag.elements, warnings=bag.warnings, cut_off=missing)


def _walked(data: memoryview) -> Index:
    try:
        return walked_index(data)
    except DAMAGE as error:
        raise _LostFactsError(told_damage(error)) from error


def _missing(element: PlacedElement, index: Index) -> int:
    """How many samples of an element are not in the file."""
    entries = element.entries
    return max((element.count - one.absent - index.counts.get(one.channel, 0) for one in entries), default=0)


def _cut(facts: RecordingFacts, index: Index, missing: int) -> RecordingFacts:
    """What there is of a file that was cut off."""
    cut = (f"the file is cut off: {missing} samples are missing at the end",) if missing else ()
    elements = []
    for element in facts.elements:
        there = [index.counts.get(one.channel, 0) for one in element.entries if not one.absent]
        entries = tuple(
            msgspec.structs.replace(one, absent=element.count - index.counts.get(one.channel, 0)) if one.absent else one
            for one in element.entries
        )
        elements.append(msgspec.structs.replace(element, count=min([element.count, *there]), entries=entries))
    return msgspec.structs.replace(facts, elements=tuple(elements), warnings=(*facts.warnings, *cut))


def _attached(data: memoryview, index: Index, name: str, unpack: Callable[[bytes], Any]) -> Any:
    try:
        at, _ = index.attachments[name]
        return unpack(attachment(record_at(data, at, Opcode.ATTACHMENT))[2])
    except DAMAGE as error:
        raise _LostFactsError(told_damage(error)) from error


def _check(facts: RecordingFacts, ticks: int) -> None:
    """Raise `_LostFactsError` for samples without a time stamp."""
    for one in facts.elements:
        if not are_samples_of(ticks, one.first, one.divider, one.count):
            raise _LostFactsError(f"'{one.name}' has samples without a time stamp")


class _LostFactsError(ValueError):
    """What silo wrote beside the messages can't be read."""
