"""What the terminal sends: its answers to our queries, taken out of what is typed, and Esc, which is a key of its own.

Answers must never reach the app as keys. Over a thin link they come in pieces: what may be the beginning of one waits
for its rest. A lone escape may be the Esc key, so it waits only as long as an escape sequence of a key may take.
"""

import re
from collections.abc import Iterable, Iterator

import msgspec
from textual import events
from textual._xterm_parser import XTermParser
from textual.message import Message

ALIVE_ANSWER = b"\x1b[0n"
ALIVE_QUERY = "\x1b[5n"
_BEGUN = re.compile(rb"\x1b(?:\[(?:0|\?[0-9;]{0,12}\$?)?)?\Z")
# these bytes can begin a key: not held for longer than an escape sequence takes
_MAYBE_KEYS = (b"\x1b", b"\x1b[")
_UNKNOWN_MODE = (b"0", b"4")  # not recognised, or off for good
_ANSWERS = re.compile(rb"\x1b\[\?2026;\d+\$y|\x1b\[0n")


class Sorted(msgspec.Struct, frozen=True):
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


# sequences of keys go on with [ or O; what ends with ESC [ was waited behind
_ALONE = re.compile("\x1b(?![\\[O])|\x1b(?=\\[\\Z)")


class KeyReader:
    """Textual's parser of what a terminal sends, for which Esc is always a key.

    Terminals send Alt and a letter as the escape character and the letter, so Textual takes both for one key, and waits
    with what follows. No key of ours has Alt, but Esc and a letter typed after it are what leaves a dialog and goes on:
    what comes in one piece with Esc, over a slow link, are the keys behind it.
    """

    def __init__(self, *, debug: bool = False) -> None:
        self._parser = XTermParser(debug)

    def feed(self, words: str) -> Iterator[Message]:
        """Yield what was typed; what ends with the escape character was waited behind for as long as needs be."""
        at = 0
        for escape in _ALONE.finditer(words):
            if escape.start() > at:
                yield from self._apart(self._parser.feed(words[at : escape.start()]))
            yield events.Key("escape", "\x1b")
            at = escape.end()
        if at < len(words):
            yield from self._apart(self._parser.feed(words[at:]))

    def tick(self) -> Iterator[Message]:
        """Yield what was the beginning of a sequence and is keys after all, as nothing came behind it."""
        yield from self._apart(self._parser.tick())

    def end(self) -> None:
        """End: what is there of a sequence is left out."""
        for _ in self._parser.feed(""):
            pass

    @staticmethod
    def _apart(messages: Iterable[Message]) -> Iterator[Message]:
        """Yield Esc and the letter of what was read as Alt and that letter: ESC O comes so, which may begin F1."""
        for message in messages:
            if isinstance(message, events.Key) and message.key.startswith("alt+") and message.character:
                yield events.Key("escape", "\x1b")
                yield events.Key(message.character, message.character)
            else:
                yield message
