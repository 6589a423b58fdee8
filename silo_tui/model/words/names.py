"""Names that have no room, of signals, loggers and files: the one rule that shortens them, so that different ones never
look alike.

Where they don't fit, the namespace that all of them share stands once above them. A name keeps its end, which tells
most. Levels on its left become their shortest beginning that no other level beside them has (`/legs/LF` → `/l…/LF`);
one that would lose a single letter stays, as a joint's `KFE` tells more than `K…`. Then the longest level loses its
middle, and keeps its last word (`drive_temperature` → `dri…temperature`, `drive…ature`). Made once per table, namespace
and width, so that scrolling changes nothing.
"""

import re
import unicodedata
from bisect import bisect_left
from collections.abc import Collection, Container, Iterable, Sequence
from functools import lru_cache

from silo_tui.model.words.text import clean

TAIL = 5  # letters that a level keeps at its end
LEAST_HEAD = 3  # letters before a last word that is kept whole
MARK = "…"
MIN_WIDTH = 8


def cells(words: str) -> int:
    """Return how many cells of a terminal a text takes."""
    if words.isascii() or words.replace(MARK, "").isascii():
        return len(words)
    return sum(
        0 if unicodedata.combining(char) else 2 if unicodedata.east_asian_width(char) in "WF" else 1 for char in words
    )


def below(prefix: str, name: str) -> str:
    """Return a name without the prefix that all names share; one of none of them as it is."""
    return name[len(prefix) :] if prefix and name.startswith(f"{prefix}/") else name


def first_levels(names: Iterable[str], prefix: str) -> frozenset[str]:
    """Return what stands first behind the prefix that all names share: `legs` of `/log/legs/LF/contact`."""
    return frozenset(name[len(prefix) + 1 :].partition("/")[0] for name in names if name.startswith(prefix + "/"))


def without_prefix(words: str, prefix: str, levels: Container[str]) -> str:
    """Return words in which signals have the names that tables give them: `/legs/LF` for `/log/legs/LF`.

    Only what goes on with one of `levels` is a signal: a file below a folder of that name keeps its path.
    """
    if not prefix or prefix not in words:
        return words
    signal = re.compile(rf"(?<![\w/.~-]){re.escape(prefix)}(?=/([\w*?-]+))")
    return signal.sub(lambda found: "" if found[1] in levels or set(found[1]) & set("*?") else found[0], words)


def shared_space(names: Collection[str], width: int, room: int) -> str:
    """Return the namespace to tell once above names, in at most `room` cells; none where all fit into `width` cells."""
    if not names or max(map(cells, names)) <= width:
        return ""
    first, last = min(names).split("/")[:-1], max(names).split("/")[:-1]
    same = next((at for at, (one, other) in enumerate(zip(first, last, strict=False)) if one != other), None)
    levels = first[: min(len(first), len(last)) if same is None else same]
    while levels and cells("/".join(levels)) > room:
        levels.pop()
    return "/".join(levels)


def fitting_names_below(names: Sequence[str], width: int, room: int) -> tuple[str, list[str]]:
    """Return what stands once above names in at most `room` cells, and the names below it in at most `width` each."""
    space = shared_space(names, width, room)
    return space, fitting_names([name[len(space) + bool(space) :] for name in names], width)


def next_levels(begun: str, names: Sequence[str]) -> list[str]:
    """Return what a part of a name may become, up to the end of its level."""
    found: dict[str, None] = {}
    for name in names:
        at = name.casefold().find(begun.casefold())
        if at >= 0:
            end = name.find("/", at + len(begun))
            found[name[at:] if end < 0 else name[at:end]] = None
    return [one for one in found if one != begun]


def fitted_among(name: str, names: tuple[str, ...], width: int) -> str:
    """Return one of some names in at most `width` cells: as it differs from the others; without others for itself."""
    return _all_fitted(names or (name,), width)[name]


@lru_cache
def _all_fitted(names: tuple[str, ...], width: int) -> dict[str, str]:
    different = list(dict.fromkeys(names))
    return dict(zip(different, fitting_names(different, width), strict=True))


def fitting_names(names: Sequence[str], width: int) -> list[str]:
    """Return names of at most `width` (8 or more) cells, in the same order; different names stay different."""
    width = max(MIN_WIDTH, width)
    cleaned = [clean(name) for name in names]
    beginnings = _Beginnings(cleaned) if any(cells(name) > width for name in cleaned) else None
    fitted = [
        name if beginnings is None or cells(name) <= width else _shortened(name, width, beginnings) for name in cleaned
    ]
    return _told_apart(cleaned, fitted, width)


class _Beginnings:
    """The shortest beginnings of levels that are unique among those beside them."""

    def __init__(self, names: Sequence[str]) -> None:
        self._children: dict[str, set[str]] = {}
        for name in names:
            parent = ""
            for level in name.split("/"):
                self._children.setdefault(parent, set()).add(level)
                parent = f"{parent}/{level}"
        self._found: dict[tuple[str, str], str] = {}

    def of(self, parent: str, level: str) -> str:
        """Return `l…` for `legs` below `parent`, the whole level where that is no longer."""
        key = parent, level
        if key not in self._found:
            others = sorted(self._children[parent])
            at = bisect_left(others, level)  # only its neighbours begin as long with the same letters
            beside = others[max(0, at - 1) : at] + others[at + 1 : at + 2]
            length = 1 + max((_common([level, other]) for other in beside), default=0)
            self._found[key] = level[:length] + MARK if length + 2 < len(level) else level
        return self._found[key]


def _shortened(name: str, width: int, beginnings: _Beginnings) -> str:
    levels = name.split("/")
    parent = ""
    for at, level in enumerate(levels[:-1]):
        levels[at] = beginnings.of(parent, level)
        parent = f"{parent}/{level}"
        if cells("/".join(levels)) <= width:
            return "/".join(levels)
    for at in sorted(range(len(levels)), key=lambda at: -len(levels[at])):
        surplus = cells("/".join(levels)) - width
        if surplus <= 0:
            break
        levels[at] = _without_middle(levels[at], len(levels[at]) - surplus)
    words = "/".join(levels)
    return words if cells(words) <= width else _last(name, width)


def _without_middle(level: str, length: int) -> str:
    """Return the level in `length` letters, seven or more.

    They are three or more of its beginning, by which most differ, and its last word, else of its end at most five.
    """
    if length >= len(level) or len(level) <= TAIL + 2:
        return level
    length, word = max(length, TAIL + 2), len(level.rpartition("_")[2])
    tail = word if TAIL < word <= length - 1 - LEAST_HEAD else min(TAIL, length - 1 - LEAST_HEAD)
    return level[: length - 1 - tail] + MARK + level[-tail:]


def _last(words: str, width: int) -> str:
    while cells(words) >= width:
        words = words[1:]
    return MARK + words


def _told_apart(names: Sequence[str], fitted: list[str], width: int) -> list[str]:
    """Give names that look alike the letters in which they differ, or a number where that isn't enough."""
    for _ in range(2):
        alike: dict[str, list[int]] = {}
        for at, words in enumerate(fitted):
            alike.setdefault(words, []).append(at)
        groups = [group for group in alike.values() if len(group) > 1]
        if not groups:
            return fitted
        for group in groups:
            for at, words in zip(group, _differing([names[at] for at in group], width), strict=True):
                fitted[at] = words
    taken: set[str] = set()
    for at, words in enumerate(fitted):
        number, found = 1, words
        while found in taken:
            number += 1
            found = _numbered(names[at], number, width)
        taken.add(found)
        fitted[at] = found
    return fitted


def _differing(names: list[str], width: int) -> list[str]:
    """Return what lies between the common beginning and the common end of some names, and what fits around it."""
    begin = _common(names)
    end = _common([name[begin:][::-1] for name in names])
    return [_around(name, begin, len(name) - end, width) for name in names]


def _common(names: Sequence[str]) -> int:
    """Return how many letters all of them begin with alike."""
    first, last = min(names), max(names)
    return next((at for at, pair in enumerate(zip(first, last, strict=False)) if pair[0] != pair[1]), len(first))


def _around(name: str, begin: int, end: int, width: int) -> str:
    room = width - 2 - (end - begin)
    tail = min(len(name) - end, max(0, min(room, TAIL + 1)))
    head = max(0, room - tail)
    words = (MARK if begin > head else "") + name[max(0, begin - head) : end]
    rest = name[end:]
    words += rest if len(rest) <= tail else MARK + rest[len(rest) - tail :] if tail else MARK
    return words if cells(words) <= width else _last(words, width)


def _numbered(name: str, number: int, width: int) -> str:
    suffix = f"~{number}"
    words = name
    while words and cells(words) > width - len(suffix):
        words = words[:-1]
    return words + suffix
