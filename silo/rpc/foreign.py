"""Messages that came under a robot's keys and can't be its own: left out, counted, and told once in a line.

On an open network anybody may send bytes there, and a robot's silo may be newer than ours. Neither may end a program
that listens, or fill its terminal.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from silo.errors import ConnectionLostError

log = logging.getLogger("silo.client")

# what decoders of msgspec and NumPy, and arithmetic with the numbers that they find, raise for bytes of any kind
NOT_UNDERSTOOD = (
    msgspec.MsgspecError, UnicodeDecodeError, RecursionError, ValueError, TypeError, ArithmeticError, LookupError,
    MemoryError, SyntaxError,
)  # fmt: skip
MOST = 50  # that may come without one that is understood: then it is another silo that speaks


class Foreign:
    """What was left out of one kind of messages. `understood` after one that made sense."""

    def __init__(self, what: str) -> None:
        self.count = 0
        self._what = what
        self._in_a_row = 0

    def understood(self) -> None:
        """Note that one made sense."""
        self._in_a_row = 0

    def leave_out(self, key: str, error: Exception) -> None:
        """Note one that makes none; raises ConnectionLostError where nothing else has come for long."""
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
