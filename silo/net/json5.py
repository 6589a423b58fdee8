"""Reading JSON5, as far as configurations of Zenoh use it: what a file says itself, without Zenoh's defaults."""

import json
import re
from typing import Any

_TOKEN = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/)|(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|(?P<mark>[{}\[\]:,])"""
    r"""|(?P<word>[^\s{}\[\]:,"'/]+)""",
    re.DOTALL,
)
_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")


def read_json5(text: str) -> Any:
    """Return the value of a text. Raises ValueError for what is no JSON5."""
    tokens: list[str] = []
    place = 0
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise ValueError(f"unexpected {text[place]!r}")
        place = found.end()
        if found.lastgroup == "text":
            tokens.append(_quoted(found[0]))
        elif found.lastgroup == "word":
            tokens.append(found[0] if _is_value(found[0], text[place:]) else json.dumps(found[0]))
        elif found.lastgroup == "mark":
            if found[0] in "}]" and tokens and tokens[-1] == ",":
                tokens.pop()  # JSON5 lets a comma stand there
            tokens.append(found[0])
    return json.loads(" ".join(tokens))


def _quoted(text: str) -> str:
    if text[0] == '"':
        return text.replace("\\\n", "")
    return json.dumps(text[1:-1].replace("\\'", "'"))


def _is_value(word: str, rest: str) -> bool:
    """Whether a word stands for itself: a key never does."""
    return not rest.lstrip().startswith(":") and (word in ("true", "false", "null") or bool(_NUMBER.fullmatch(word)))
