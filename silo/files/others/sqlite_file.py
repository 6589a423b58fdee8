"""A `.db3` file of rosbag2 (storage `sqlite3`): topics, log times and messages by its own index."""

import contextlib
import os
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from numpy.typing import NDArray

from silo.errors import FileFormatError
from silo.files.others.topics import SOME, Equal, Topic

MARK = b"SQLite format 3\0"
_DEFINITIONS = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"


class SqliteFile:
    """One file; `packed` says whether each message is compressed by itself."""

    def __init__(self, path: Path, *, packed: bool) -> None:
        self.path = path
        self.packed = packed
        # a write-ahead log needs a folder that can be written; where there is none, nobody writes the file either
        how = "mode=ro" if os.access(path.parent, os.W_OK) else "mode=ro&immutable=1"
        try:
            self._database = sqlite3.connect(f"{path.resolve().as_uri()}?{how}", uri=True, check_same_thread=False)
            self._topics = self.rows("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
        except (sqlite3.Error, ValueError) as error:
            raise FileFormatError(f"'{path}' can't be read as a bag: {error}") from error

    def rows(self, query: str, *values: object) -> list[tuple[object, ...]]:
        """Return what a query finds. Raises ValueError for a damaged file."""
        try:
            return self._database.execute(query, values).fetchall()
        except sqlite3.Error as error:
            raise ValueError(f"damaged: {error}") from error

    def topics(self) -> list[Topic]:
        """Return the topics that have messages."""
        definitions: dict[str, tuple[str, str]] = {}
        with contextlib.suppress(ValueError):  # a table of newer bags only
            definitions = {str(kind): (str(how), str(text)) for kind, how, text in self.rows(_DEFINITIONS)}
        used = {number for (number,) in self.rows("SELECT DISTINCT topic_id FROM messages")}
        return [
            Topic(str(name), str(kind), str(encoding), *definitions.get(str(kind), ("", "")), SqliteTopic(self, number))
            for number, name, kind, encoding in self._topics
            if number in used and isinstance(number, int)
        ]


@dataclass(frozen=True)
class SqliteTopic:
    """The messages of one topic of a file, in the order of time."""

    file: SqliteFile
    number: int

    def stamps(self) -> NDArray[np.int64]:
        """Return their log times."""
        found = self.file.rows("SELECT timestamp FROM messages WHERE topic_id = ? ORDER BY timestamp, id", self.number)
        return np.array([stamp for (stamp,) in found], np.int64)

    def messages(self) -> Iterator[Equal]:
        """Return what they hold, those of one size together. Raises ValueError for one that is damaged."""
        return self._equal("SELECT data FROM messages WHERE topic_id = ? ORDER BY timestamp, id")

    def some(self) -> Iterator[Equal]:
        """Return the first messages."""
        return self._equal(f"SELECT data FROM messages WHERE topic_id = ? LIMIT {SOME}")

    def _equal(self, query: str) -> Iterator[Equal]:
        found = [data for (data,) in self.file.rows(query, self.number)]
        contents = [data for data in found if isinstance(data, bytes)]
        if len(contents) < len(found):
            raise ValueError("a message is no bytes")
        if self.file.packed:
            unpack = zstandard.ZstdDecompressor()
            contents = [unpack.decompressobj().decompress(data) for data in contents]
        yield from equal(contents)


def equal(contents: Sequence[bytes]) -> Iterator[Equal]:
    """Return messages of one size together: which they are, and their bytes."""
    sizes: dict[int, list[int]] = {}
    for number, content in enumerate(contents):
        sizes.setdefault(len(content), []).append(number)
    for size, which in sizes.items():
        rows = np.frombuffer(b"".join([contents[number] for number in which]), np.uint8)
        yield np.array(which, np.int64), rows.reshape(len(which), size)
