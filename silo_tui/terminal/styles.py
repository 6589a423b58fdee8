"""Styles of cells as SGR sequences: parsed once, numbered, and the shortest way from one to the next.

Number 0 is the terminal's default. Measured: of a frame's bytes two thirds were styles that repeated what was in force.
"""

import msgspec

DEFAULT = 0

# what shows on a blank cell: underlines, reverse, strike, frame, overline
_ON_BLANKS = frozenset({"4", "7", "9", "21", "51", "52", "53"})
_OFF = {
    "22": {"1", "2"}, "23": {"3"}, "24": {"4", "21"}, "25": {"5", "6"}, "27": {"7"}, "28": {"8"}, "29": {"9"},
    "54": {"51", "52"}, "55": {"53"},
}  # fmt: skip
_CODES_OF_COLOR = {"5": 3, "2": 5}  # 38;5;n and 38;2;r;g;b


class Look(msgspec.Struct, frozen=True):
    """One style: colours as their SGR codes (empty: the terminal's own) and what else is on."""

    front: str = ""
    back: str = ""
    flags: tuple[str, ...] = ()


class Styles:
    """Numbers for the styles that a program uses."""

    def __init__(self) -> None:
        self._looks = [Look()]
        self._numbers = {Look(): DEFAULT}
        self._after: dict[tuple[int, str], int] = {}
        self._grounds: dict[int, int] = {}
        self._ways: dict[tuple[int, int], str] = {}

    def after(self, style: int, codes: str) -> int:
        """Return the style in force after the SGR sequence `codes` (what stands between `ESC[` and `m`)."""
        key = (style, codes)
        found = self._after.get(key)
        if found is None:
            found = self._after[key] = self._number(_changed(self._looks[style], codes))
        return found

    def ground(self, style: int) -> int:
        """Return the style that a blank of this style looks like: of most only the background shows."""
        found = self._grounds.get(style)
        if found is None:
            look = self._looks[style]
            shows = any(flag.partition(":")[0] in _ON_BLANKS for flag in look.flags)
            found = self._grounds[style] = style if shows else self._number(Look(back=look.back))
        return found

    def is_plain(self, style: int) -> bool:
        """Return whether a style is a background and nothing else."""
        look = self._looks[style]
        return not look.flags and not look.front

    def way(self, old: int, new: int) -> str:
        """Return the shortest sequence that leads from one style to another; empty where they are the same."""
        key = (old, new)
        found = self._ways.get(key)
        if found is None:
            found = self._ways[key] = _way(self._looks[old], self._looks[new])
        return found

    def _number(self, look: Look) -> int:
        number = self._numbers.get(look)
        if number is None:
            number = self._numbers[look] = len(self._looks)
            self._looks.append(look)
        return number


def _changed(look: Look, codes: str) -> Look:
    front, back, flags = look.front, look.back, dict.fromkeys(look.flags)
    words = codes.split(";")
    at = 0
    while at < len(words):
        word = words[at].lstrip("0")  # an empty one is 0 too
        taken = 1
        if word in {"38", "48"}:
            taken = _CODES_OF_COLOR.get(words[at + 1] if at + 1 < len(words) else "", 1)
            color = ";".join(words[at : at + taken])
            front, back = (color, back) if word == "38" else (front, color)
        elif not word:
            front, back, flags = "", "", {}
        elif word.startswith(("38:", "48:")):
            front, back = (word, back) if word.startswith("38") else (front, word)
        elif word.isdigit() and (30 <= int(word) <= 39 or 90 <= int(word) <= 97):
            front = "" if word == "39" else word
        elif word.isdigit() and (40 <= int(word) <= 49 or 100 <= int(word) <= 107):
            back = "" if word == "49" else word
        elif word in _OFF:
            flags = {flag: None for flag in flags if flag.partition(":")[0] not in _OFF[word]}
        else:
            flags[word] = None
        at += taken
    return Look(front, back, tuple(sorted(flags)))


def _way(old: Look, new: Look) -> str:
    if old == new:
        return ""
    afresh = ["", *new.flags, *filter(None, (new.front, new.back))]
    if not set(old.flags) <= set(new.flags):
        return f"\x1b[{';'.join(afresh)}m"
    codes = [flag for flag in new.flags if flag not in old.flags]
    codes += [new.front or "39"] if new.front != old.front else []
    codes += [new.back or "49"] if new.back != old.back else []
    return min((f"\x1b[{';'.join(way)}m" for way in (afresh, codes)), key=len)
