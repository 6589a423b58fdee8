"""What is painted moves no cursor: words of robots, files and clients may have any character."""

import unicodedata

from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

_DROPPED = {"Cc", "Cf", "Zl", "Zp"}  # of no width: control characters, those that turn a text round


class Printable(LineFilter):
    """Takes such characters out of lines as they are painted, whoever made them; lists show them as dots before."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Return the segments without them; most have none."""
        if all(one.control or one.text.isprintable() for one in segments):
            return segments
        return [one if one.control else Segment(_printable(one.text), one.style) for one in segments]


def _printable(text: str) -> str:
    return "".join(
        "?" if category == "Cs" else letter
        for letter in text
        if (category := unicodedata.category(letter)) not in _DROPPED
    )
