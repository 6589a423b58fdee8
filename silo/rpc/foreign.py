"""Messages that came under a robot's keys and can't be its own: left out, counted, and told once in a line.

On an open network anybody may send bytes there, and a robot's silo may be newer than ours. Neither may end a program
that listens, or fill its terminal.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import msgspec

from silo.errors import ConnectionLostError

T = TypeVar("T")

log = logging.getLogger("silo.client")

# what decoders of msgspec and NumPy, and arithmetic with the numbers that they find, raise for bytes of any kind
NOT_UNDERSTOOD = (
    msgspec.MsgspecError, UnicodeDecodeError, RecursionError, ValueError, TypeError, ArithmeticError, LookupError,
    MemoryError, SyntaxError,
)  # fmt: skip
MOST = 50  # that may come without one that is understood: then it is another silo that speaks


class Foreign:
    """What was left out of one kind of messages."""

    def __init__(self, what: str) -> None:
        self.count = 0
        self._what = what
        self._in_a_row = 0

    def read(self, key: str, decode: Callable[[], T]) -> T | None:
        """Return what one says, None for one that makes no sense.

        Raises ConnectionLostError where nothing else has come for long.
        """
        try:
            found = decode()
        except (*NOT_UNDERSTOOD, ConnectionLostError) as error:
            self._leave_out(key, error)
            return None
        self._in_a_row = 0
        return found

    def _leave_out(self, key: str, error: Exception) -> None:
        self.count += 1
        self._in_a_row += 1
        if self.count == 1:
            log.warning("%s under %s can't be understood and is left out, as all like it: %s", self._what, key, error)
        if self._in_a_row >= MOST:
            self._in_a_row = 0
            raise ConnectionLostError(
                f"{MOST} times in a row {self._what} under {key} that this silo doesn't understand ({error}): "
                "install the same version of silo on both sides, or see who else sends there"
            )


@contextmanager
def understood(what: str, who: str) -> Iterator[None]:
    """Raise ConnectionLostError for what can't be understood of what somebody answered."""
    try:
        yield
    except NOT_UNDERSTOOD as error:
        raise ConnectionLostError(
            f"{who} sends {what} that this version of silo doesn't understand: {error}"
        ) from error
