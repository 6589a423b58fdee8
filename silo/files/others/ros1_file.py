"""A `.bag` file of ROS 1 (format 2.0), read by `rosbags`: its messages become those of ROS 2, which silo reads.

The package makes CDR of each message. What it reads is bounded here: a chunk unpacks to no more than others may.
"""

import bz2
import functools
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.errors import FileFormatError
from silo.files.mcap.chunks import most_room
from silo.files.optional_packages import need
from silo.files.others.topics import Bad, Equal, FileTopic, equal

_SECTION = re.compile(r"^=+\n", re.MULTILINE)
_SEQUENCE = re.compile(r"^\s*uint32\s+seq\b.*\n?", re.MULTILINE)
_HEADER = "std_msgs/Header"
_DAMAGE = (ValueError, KeyError, EOFError, OSError, AssertionError, struct.error)  # of the package, for damaged files


class RosbagFile:
    """One file."""

    def __init__(self, path: Path) -> None:
        """Open it and read its index.

        Raises FileFormatError for one that is damaged or has no index, SiloError without `rosbags`.
        """
        self.path = path
        rosbag1: Any = need("rosbags.rosbag1", "bags", "bags of ROS 1")
        self._reader = rosbag1.Reader(path)
        try:
            self._reader.open()
        except (rosbag1.ReaderError, *_DAMAGE) as error:
            words = str(error)
            way_out = "; `rosbag reindex` of ROS 1 makes the index anew" if "index" in words else ""
            raise FileFormatError(f"'{path}' can't be read as a bag of ROS 1: {words}{way_out}") from error
        except MemoryError:
            raise FileFormatError(f"'{path}' announces more than there is memory: it is damaged") from None
        self._reader.chunks = {
            place: chunk._replace(decompressor=_bounded(chunk.decompressor))
            for place, chunk in self._reader.chunks.items()
        }

    def topics(self) -> list[FileTopic]:
        """Return the topics that have messages; several publishers of one are parts of it."""
        made = []
        for connection in self._reader.connections:
            if self._reader.indexes.get(connection.id):
                definition = _as_of_ros2(connection.msgdef.data, connection.msgtype)
                stored = RosbagConnection(self._reader, connection, definition)
                made.append(FileTopic(connection.topic, connection.msgtype, "cdr", "ros2msg", definition, stored))
        return made


@functools.lru_cache(64)  # the package writes and compiles a function for each type
def _converter(name: str, definition: str) -> Callable[[bytes], bytes]:
    """Return what makes CDR of a message. Raises whatever the parser of definitions raises."""
    types: Any = need("rosbags.typesys", "bags", "bags of ROS 1")
    store = types.get_typestore(types.Stores.EMPTY)
    store.register(types.get_types_from_msg(definition, name))
    return lambda data: bytes(store.ros1_to_cdr(data, name))


@dataclass(frozen=True)
class RosbagConnection:
    """The messages of one publisher of a topic."""

    reader: Any  # of the package
    connection: Any
    definition: str
    damage: str = ""

    def stamps(self) -> NDArray[np.int64]:
        """Return their log times, rising."""
        return np.array([entry.time for entry in self.reader.indexes[self.connection.id]], np.int64)

    def messages(self, bad: Bad, most: int | None = None) -> Iterator[Equal]:
        """Return what they, or the first of them, hold; `bad` gets those that can't be read."""
        total = len(self.stamps())
        wanted = total if most is None else min(most, total)
        made: list[tuple[int, bytes]] = []
        try:
            convert = _converter(self.connection.msgtype, self.definition)
            for place, (_, _, data) in enumerate(self.reader.messages([self.connection])):
                if place == wanted:
                    break
                try:
                    made.append((place, convert(data)))
                except Exception as error:  # noqa: BLE001 - of a library, for whatever a message holds
                    bad.append((np.array([place]), str(error) or type(error).__name__))
        except Exception as error:  # noqa: BLE001 - likewise: what follows can't be found
            seen = {number for number, _ in made} | {int(which[0]) for which, _ in bad}
            gone = [number for number in range(wanted) if number not in seen]
            bad.append((np.array(gone, np.int64), f"damaged: {str(error) or type(error).__name__}"))
        yield from equal(made)


def _as_of_ros2(definition: str, name: str) -> str:
    """The definition without the number that a header of ROS 1 begins with, which is left out of its messages, too."""
    sections = _SECTION.split(definition)
    for place, section in enumerate(sections):
        head = section.partition("\n")[0].removeprefix("MSG:").strip() if place else name.replace("/msg/", "/")
        if head == _HEADER:
            sections[place] = _SEQUENCE.sub("", section)
    return ("=" * 80 + "\n").join(sections)


def _bounded(decompressor: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """The same, for chunks that unpack to no more than a file may ask for."""
    name = getattr(decompressor, "__module__", "") or ""

    def unpacked(data: bytes) -> bytes:
        most = most_room(data)
        if "bz2" in name:
            made = bz2.BZ2Decompressor().decompress(data, most + 1)
        elif "lz4" in name:
            import lz4.frame

            made = lz4.frame.LZ4FrameDecompressor().decompress(data, most + 1)
        else:
            made = decompressor(data)
        if len(made) > most:
            raise ValueError(f"{len(data):,} bytes unpack to more than {most:,}")
        return made

    return unpacked
