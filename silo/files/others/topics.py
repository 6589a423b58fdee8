"""What any bag has: topics, each with messages somewhere in a file."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Equal = tuple[NDArray[np.int64], NDArray[np.uint8]]  # which messages, and their bytes, shape `(n, size)`


SOME = 64  # messages that are looked at to know how long arrays are


class Messages(Protocol):
    """The messages of a topic in one file, in the order in which they stand there."""

    def stamps(self) -> NDArray[np.int64]:
        """Return the log times."""

    def messages(self) -> Iterable[Equal]:
        """Return what they hold, those of one size together."""

    def some(self) -> Iterable[Equal]:
        """Return what a few of them hold."""


@dataclass(frozen=True)
class Topic:
    """A topic of one file: its type, how its messages are encoded, and the definition as far as the file has it."""

    name: str
    type: str
    encoding: str
    language: str
    definition: str
    stored: Messages
