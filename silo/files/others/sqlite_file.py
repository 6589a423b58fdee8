"""A `.db3` file of rosbag2 (storage `sqlite3`): topics, log times and messages by its own index."""

import contextlib
import os
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silo.core.quantities.writing import many
from silo.errors import FileFormatError
from silo.files.others.topics import Bad, Equal, FileTopic, equal

_DEFINITIONS = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"


class SqliteFile:
    """One file."""

    def __init__(self, path: Path) -> None:
        self.path = path
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

    def messages(self, column: str, topic: int, most: int = -1) -> tuple[list[tuple[object, object]], str]:
        """Return number and a column of messages of a topic, and what is damaged in the file.

        Then they are those before and behind that place.
        """
        start = f"SELECT id, {column} FROM messages"
        found, why = self._there(f"{start} WHERE topic_id = ? ORDER BY timestamp, id LIMIT ?", topic, most)
        if why:
            ways = [
                self._there(f"{start} NOT INDEXED WHERE topic_id = ? ORDER BY id {way} LIMIT ?", topic, most)[0]
                for way in ("ASC", "DESC")
            ]
            found = [*found, *ways[0], *ways[1]]
        return list({number: (number, value) for number, value in found}.values()), why

    def _there(self, query: str, *values: object) -> tuple[list[tuple[object, ...]], str]:
        """Return what a query finds up to where the file is damaged, and how it is."""
        found: list[tuple[object, ...]] = []
        try:
            for row in self._database.execute(query, values):
                found.append(row)  # noqa: PERF402  # what was found before an error is kept
        except (sqlite3.Error, ValueError, OverflowError) as error:
            return found, f"damaged: {error}"
        return found, ""

    def topics(self) -> list[FileTopic]:
        """Return the topics that have messages."""
        definitions: dict[str, tuple[str, str]] = {}
        with contextlib.suppress(ValueError):  # a table of newer bags only
            definitions = {str(kind): (str(how), str(text)) for kind, how, text in self.rows(_DEFINITIONS)}
        found, damage = self._there("SELECT DISTINCT topic_id FROM messages")
        used = {number for number, *_ in found}
        return [
            FileTopic(
                str(name), str(kind), str(encoding), *definitions.get(str(kind), ("", "")), SqliteTopic(self, number)
            )
            for number, name, kind, encoding in self._topics
            if isinstance(number, int) and (number in used or damage)
        ]


@dataclass(frozen=True)
class SqliteTopic:
    """The messages of one topic of a file, in the order of time."""

    file: SqliteFile
    number: int

    @cached_property
    def _logged(self) -> tuple[list[int], NDArray[np.int64], str]:
        """Numbers of the rows, their log times, and what is wrong with the file behind them."""
        found, why = self.file.messages("timestamp", self.number)
        whole = sorted(
            (stamp, number)
            for number, stamp in found
            if isinstance(number, int) and isinstance(stamp, int) and -(2**63) <= stamp < 2**63
        )
        if len(whole) < len(found):
            why = f"{many(len(found) - len(whole), 'message')} without a time"
        return [number for _, number in whole], np.array([stamp for stamp, _ in whole], np.int64), why

    def stamps(self) -> NDArray[np.int64]:
        """Return their log times."""
        return self._logged[1]

    @property
    def damage(self) -> str:
        """What is missing, in words."""
        return self._logged[2]

    def messages(self, bad: Bad, most: int | None = None) -> Iterator[Equal]:
        """Return what they, or the first of them, hold; `bad` gets those that can't be read."""
        found, why = self.file.messages("data", self.number, -1 if most is None else most)
        data = {number: content for number, content in found if isinstance(number, int)}
        contents: list[tuple[int, bytes]] = []
        for place, number in enumerate(self._logged[0][:most]):
            content = data.get(number)
            if isinstance(content, bytes):
                contents.append((place, content))
            else:
                bad.append((np.array([place]), "it is no bytes" if number in data else why or "it is gone"))
        yield from equal(contents)
