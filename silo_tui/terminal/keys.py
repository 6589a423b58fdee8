"""Esc is a key of its own: what comes in one piece with it, over a slow link, are the keys behind it.

Terminals send Alt and a letter as the escape character and the letter, so Textual takes both for one key, and waits
with what follows. No key of ours has Alt, but Esc and a letter typed after it are what leaves a dialog and goes on.
"""

import re
from collections.abc import Iterable, Iterator

from textual import events
from textual._xterm_parser import XTermParser
from textual.message import Message

# sequences of keys go on with [ or O; what ends with ESC [ was waited behind
_ALONE = re.compile("\x1b(?![\\[O])|\x1b(?=\\[\\Z)")


class KeyReader:
    """Textual's parser of what a terminal sends, for which Esc is always a key."""

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
