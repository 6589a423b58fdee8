"""What any bag has: topics, each with messages somewhere in a file."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import zstandard
from numpy.typing import NDArray

from silo.core.names import grouped
from silo.files.mcap.chunks import most_room

Equal = tuple[NDArray[np.int64], NDArray[np.uint8]]  # which messages, and their bytes, shape `(n, size)`
Bad = list[tuple[NDArray[np.int64], str]]  # which messages can't be read, and why


SOME = 64  # messages that are looked at to know how long arrays are


class Messages(Protocol):
    """The messages of a topic in one file, in the order in which they stand there."""

    @property
    def damage(self) -> str:
        """What is known to be missing, in words."""

    def stamps(self) -> NDArray[np.int64]:
        """Return the log times."""

    def messages(self, bad: Bad, most: int | None = None) -> Iterable[Equal]:
        """Return what they, or about so many of them, hold, those of one size together.

        `bad` gets those that can't be read.
        """


@dataclass(frozen=True)
class FileTopic:
    """A topic of one file: its type, how its messages are encoded, and the definition as far as the file has it."""

    name: str
    type: str
    encoding: str
    language: str
    definition: str
    stored: Messages


def equal(contents: Sequence[tuple[int, bytes]]) -> Iterator[Equal]:
    """Return messages of one size together: which they are, and their bytes."""
    for size, those in grouped((len(content), (place, content)) for place, content in contents).items():
        rows = np.frombuffer(b"".join([content for _, content in those]), np.uint8)
        yield np.array([place for place, _ in those], np.int64), rows.reshape(len(those), size)


@dataclass(frozen=True)
class Unpacked:
    """Messages that are compressed one by one."""

    stored: Messages

    @property
    def damage(self) -> str:
        """What is known to be missing, in words."""
        return self.stored.damage

    def stamps(self) -> NDArray[np.int64]:
        """Return the log times."""
        return self.stored.stamps()

    def messages(self, bad: Bad, most: int | None = None) -> Iterator[Equal]:
        """Return what they, or a few of them, hold; `bad` gets those that can't be read."""
        contents: list[tuple[int, bytes]] = []
        for which, rows in self.stored.messages(bad, most):
            for place, row in zip(which.tolist(), rows, strict=True):
                try:
                    contents.append((place, _unpacked(row.tobytes())))
                except (ValueError, zstandard.ZstdError) as error:  # noqa: PERF203  # each may be damaged
                    bad.append((np.array([place]), str(error)))
        yield from equal(contents)


def _unpacked(data: bytes) -> bytes:
    """What a message is that is compressed by itself. Raises ValueError or ZstdError."""
    most = most_room(data)
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        content: bytes = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"{len(data):,} bytes unpack to more than {most:,}")
    return content
