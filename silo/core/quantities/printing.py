"""How things show themselves: in notebooks as a caption and a table in plain HTML, in terminals harmless."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

MOST_ROWS = 60  # in a notebook; nobody reads 10,000


def html_table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[object]], more: str = "") -> str:
    """Return a table; of many rows the first, and how many there are besides."""
    from html import escape  # 3 ms that no shell command needs

    shown = list(rows)
    left = len(shown) - MOST_ROWS
    body = "".join(_row(row, "td") for row in shown[:MOST_ROWS])
    below = f"<p>and {left} more</p>" if left > 0 else ""
    note = f"<p>{escape(more)}</p>" if more else ""
    head = f"<thead>{_row(heads, 'th')}</thead>" if shown else ""
    return f"<p><b>{escape(caption)}</b></p><table>{head}<tbody>{body}</tbody></table>{below}{note}"


def _row(cells: Sequence[object], tag: str) -> str:
    from html import escape

    return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"


def printable(text: str) -> str:
    """Return a text whose control characters are escapes, so that it can't move a terminal's cursor."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def infinite_as_text(value: Any) -> Any:
    """Return the same of dicts and lists, infinite numbers as "inf" or "-inf": JSON has none."""
    if isinstance(value, float):
        return value if abs(value) != math.inf else str(value)
    if isinstance(value, dict):
        return {key: infinite_as_text(one) for key, one in value.items()}
    return [infinite_as_text(one) for one in value] if isinstance(value, list | tuple) else value
