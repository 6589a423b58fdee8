"""What programs of silo print: no word of a file, a robot or a client may move a terminal's cursor or turn its text.

`printable` is for a cell or a line, `printable_lines` for what has several. `print_printable` has all that a program
prints go through the latter: its own words, those of its errors and warnings, what libraries say.
"""

import codecs
import io
import os
import stat
import sys

TYPE_CHECKING = False  # `typing` takes 3 ms, which `silo --version` has none for
if TYPE_CHECKING:
    from typing import TextIO


def printable(text: str) -> str:
    """Return a text on one line whose control characters are escapes, so that it can't move a terminal's cursor."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _escape(ord(letter)) for letter in text)


def printable_lines(text: str) -> str:
    """Return a text whose control characters are escapes; line breaks and tabs stay."""
    if text.replace("\n", "").replace("\t", "").isprintable():
        return text
    return "\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n"))


def _escape(code: int) -> str:
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


class PrintedStream(io.TextIOWrapper):
    """An end of this program that takes what it prints; `drawn` is the one that it stands for."""

    def __init__(self, drawn: io.TextIOWrapper) -> None:
        # past an end in ASCII click writes UTF-8
        encoding = "utf-8" if codecs.lookup(drawn.encoding).name == "ascii" else drawn.encoding
        drawn.reconfigure(encoding=encoding, errors="backslashreplace")  # names need be no UTF-8, terminals know little
        super().__init__(
            drawn.buffer, encoding, "backslashreplace", line_buffering=drawn.line_buffering,
            write_through=drawn.write_through,
        )  # fmt: skip
        self.drawn = drawn

    def write(self, text: str) -> int:
        """Print a text, its control characters as escapes."""
        super().write(printable_lines(text))
        return len(text)


def print_printable() -> None:
    """Have this program print nothing but what is printable, on both its ends; see `drawing`."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper) and not isinstance(stream, PrintedStream):  # None if a shell closed it
            setattr(sys, name, PrintedStream(stream))


def drawing(stream: "TextIO") -> "TextIO":
    """Return where escape sequences of silo's own go as they are; whoever draws makes all else printable before."""
    return stream.drawn if isinstance(stream, PrintedStream) else stream


def leave_pipes() -> None:
    """Print no more into a pipe: who reads it waits until all that have it let go of it."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and stat.S_ISFIFO(os.fstat(stream.fileno()).st_mode):
            stream.flush()
            nothing = os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC)
            os.dup2(nothing, stream.fileno())
            os.close(nothing)
