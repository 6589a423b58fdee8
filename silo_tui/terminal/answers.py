"""The terminal's answers to our queries, taken out of what is typed: they must never reach the app as keys.

Over a thin link they come in pieces: what may be the beginning of one waits for its rest. A lone escape may be the Esc
key, so it waits only as long as an escape sequence of a key may take.
"""

import re
from dataclasses import dataclass

ALIVE_ANSWER = b"\x1b[0n"
ALIVE_QUERY = "\x1b[5n"
_BEGUN = re.compile(rb"\x1b(?:\[(?:0|\?[0-9;]{0,12}\$?)?)?\Z")
# these bytes can begin a key: not held for longer than an escape sequence takes
_MAYBE_KEYS = (b"\x1b", b"\x1b[")
_UNKNOWN_MODE = (b"0", b"4")  # not recognised, or off for good
_ANSWERS = re.compile(rb"\x1b\[\?2026;\d+\$y|\x1b\[0n")


@dataclass(frozen=True)
class Sorted:
    """What came: what was typed, and the answers."""

    typed: bytes
    answers: tuple[bytes, ...]


class AnswerFilter:
    """Takes answers out of a stream of bytes."""

    def __init__(self) -> None:
        self._held = b""

    def feed(self, data: bytes) -> Sorted:
        """Return what came without the answers, and these."""
        data = self._held + data
        begun = _BEGUN.search(data)
        self._held = begun[0] if begun else b""
        whole = data[: len(data) - len(self._held)]
        return Sorted(_ANSWERS.sub(b"", whole), tuple(_ANSWERS.findall(whole)))

    def waited(self) -> bytes:
        """Return what was held and is a key after all: nothing came for as long as an escape sequence may take."""
        if self._held not in _MAYBE_KEYS:
            return b""  # no key begins so: its rest is on its way
        held, self._held = self._held, b""
        return held


def knows_mode(answer: bytes) -> bool:
    """Return whether the terminal that gave the answer knows synchronised output."""
    return answer != ALIVE_ANSWER and answer[8:-2] not in _UNKNOWN_MODE
