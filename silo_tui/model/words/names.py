"""Names that have no room, of signals, loggers and files: the one rule that shortens them, so that different ones never
look alike.

The namespace that all of them share stands once above them. A name keeps its end, and what tells it from the others:
read from its end on, a word that each name with the same rest has tells nothing (`motor` of `LF_KFE/motor/temperature`,
where no other `temperature` is beside it). These go first, an `…` in their place (`LF_KFE/…/temperature`); then words
lose what no other has either: `winding_temperature` beside `housing_temperature` becomes `win…ature`. Made of all names
that are shown together, so that scrolling changes nothing.
"""

import re
import unicodedata
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

from silo_tui.model.words.text import clean

TAIL = 5  # letters that a name keeps at its end
LEAST_HEAD = 3  # letters of a word that tells names apart, where it isn't whole
MARK = "…"
MIN_WIDTH = 8
WHOLE = 24  # cells of a label in a tree that columns give way to
COUNTED = 4  # cells behind a label in a tree: how many entries it has
_BETWEEN = re.compile(r"[\W_]+")
_PARTS = re.compile(r"[^\W_]+|[\W_]+")  # words, and what stands between them

Kept = tuple[int, int]  # letters that a part keeps of its beginning and of its end


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


def shared_space(names: Collection[str]) -> str:
    """Return the namespace that all names share, to tell it once above them; one name shares none."""
    if len(names) < 2:
        return ""
    first, last = min(names).split("/")[:-1], max(names).split("/")[:-1]
    same = next((at for at, (one, other) in enumerate(zip(first, last, strict=False)) if one != other), None)
    return "/".join(first[: min(len(first), len(last)) if same is None else same])


def inside(space: str, name: str) -> str:
    """Return a name as it stands below the namespace that is told above it."""
    return below(space, name).removeprefix("/") if space else name


def space_words(title: str, space: str, width: int, mark: str = "") -> str:
    """Return the title above names that are told below a namespace, behind the mark of their order.

    In at most `width` cells: where it has no room, the namespace alone.
    """
    words = f"{mark}{title} in {space}" if space else f"{mark}{title}"
    return words if cells(words) <= width else mark + fitted_among(space, (), width - len(mark))


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
    return among(names or (name,)).fitted(name, width)


def fitting_names(names: Sequence[str], width: int) -> list[str]:
    """Return names of at most `width` (8 or more) cells, in the same order; different names stay different."""
    shown = among(tuple(names))
    return [shown.fitted(name, width) for name in names]


class NamesShown:
    """Names that are shown together; each is made as it is asked for: of 10,000 those that are on the screen."""

    def __init__(self, names: Iterable[str]) -> None:
        self._cleaned = {name: clean(name) for name in names}
        self._fitted: dict[tuple[str, int], str] = {}
        self._taken: set[tuple[str, int]] = set()
        self._numbered: set[int] = set()  # widths in which names were made that are too short to tell them apart
        self._telling: dict[str, dict[str, Kept]] = {}

    @cached_property
    def longest(self) -> int:
        """How many cells the longest takes."""
        return max(map(cells, self._cleaned.values()), default=0)

    @cached_property
    def least(self) -> int:
        """In how many cells all of them can be told apart; in fewer some get a number."""
        return self._most(self._least_of)

    @cached_property
    def readable(self) -> int:
        """In how many cells three letters of each word that tells them apart have room; one alone is read whole."""
        return self.longest if len(self._cleaned) == 1 else self._most(self._readable_of)

    def _most(self, of: Callable[[str], tuple[list[str], dict[int, Kept]]]) -> int:
        found = 0
        for name in self._cleaned.values():
            if cells(name) > found:
                found = max(found, min(cells(name), cells(_written(*of(name)))))
        return found

    def fitted(self, name: str, width: int, count: str = "") -> str:
        """Return one of the names in at most `width` (8 or more) cells.

        Behind it stands how many entries it has, where that takes no letters that tell it apart.
        """
        if count and width - len(count) >= max(MIN_WIDTH, self.readable):
            return self.fitted(name, width - len(count)) + count
        width = max(MIN_WIDTH, width)
        if (name, width) not in self._fitted:
            if self.longest > width and self.least > width and width not in self._numbered:
                self._numbered.add(width)  # numbers go by the order of the names
                few = (each for each, one in self._cleaned.items() if cells(_written(*self._least_of(one))) > width)
                self._fitted |= {(each, width): self._made(self._cleaned[each], width) for each in few}
            if (name, width) not in self._fitted:
                self._fitted[name, width] = self._made(self._cleaned[name], width)
        return self._fitted[name, width]

    def _made(self, name: str, width: int) -> str:
        words = name if cells(name) <= width else self._shortened(name, width)
        number, found = 1, words
        while (found, width) in self._taken:
            number += 1
            suffix = f"~{number}"
            found = _last(name, width - len(suffix)) + suffix
        self._taken.add((found, width))
        return found

    def _shortened(self, name: str, width: int) -> str:
        """Return a name with what tells it apart, and as much beside it as has room."""
        parts, kept = self._least_of(name)
        if cells(words := _written(parts, kept)) > width:
            return _last(words, width)
        for ats, letters, least in _wishes(parts, kept):
            kept = _grown(parts, kept, ats, letters, least, width)
        *levels, slash = [-1, *(at for at, part in enumerate(parts) if "/" in part)]
        if levels and not any(any(kept[at]) for at in range(slash) if _is_word(parts[at])):
            first = next(at for at, part in enumerate(parts) if _is_word(part))
            kept = _grown(parts, kept, [first, slash], len(parts[first]), LEAST_HEAD, width)
        return _written(parts, kept)

    def _readable_of(self, name: str) -> tuple[list[str], dict[int, Kept]]:
        """Return the same with three letters of each word that tells it apart."""
        parts, kept = self._least_of(name)
        words = (at for at in _told(parts, kept) if kept[at][1] < TAIL)
        return parts, kept | {at: (max(LEAST_HEAD, kept[at][0]), kept[at][1]) for at in words}

    def _least_of(self, name: str) -> tuple[list[str], dict[int, Kept]]:
        """Return the parts of a name, and what of each tells it from the other names; of its last word the end too."""
        parts, kept, end = _PARTS.findall(name), {}, ""
        last = _last_word(parts)
        for at in reversed(range(len(parts))):
            part, read = parts[at], self._read(parts[at])
            head, tail = self._telling_before(end)[read] if len(self._before[end]) > 1 else (0, 0)
            if at == last - 1 and len(parts[last]) < TAIL:
                kept[at] = 0, len(part)  # `_x`, ` > 50`
            elif at < last:
                kept[at] = (head, 0) if head <= tail else (0, tail)
            else:
                least = min(TAIL, len(part)) if at == last else len(part)
                kept[at] = (head, least) if head + len(MARK) + least < tail else (0, max(tail, least))
            end = read + end
        return parts, kept

    def _read(self, part: str) -> str:
        """Return a part as names are told apart: what stands between words alike, where words alone do it."""
        return part if _is_word(part) or not self._by_words else " "

    @cached_property
    def _by_words(self) -> bool:
        names = set(self._cleaned.values())
        return len({_BETWEEN.sub(" ", name) for name in names}) == len(names)

    @cached_property
    def _before(self) -> dict[str, set[str]]:
        """What stands before each end of a name."""
        found: dict[str, set[str]] = {}
        for name in self._cleaned.values():
            end = ""
            for part in map(self._read, reversed(_PARTS.findall(name))):
                found.setdefault(end, set()).add(part)
                end = part + end
            found.setdefault(end, set()).add("")
        return found

    def _telling_before(self, end: str) -> dict[str, Kept]:
        """Return of how many letters each part before an end has a beginning, and an end, that no other there has."""
        if end not in self._telling:
            beside = self._before[end]
            heads, tails = _unique(beside), _unique([part[::-1] for part in beside])
            self._telling[end] = {part: (heads[part], tails[part[::-1]]) for part in beside}
        return self._telling[end]


class NamesInTree:
    """Names of which a tree shows level by level, each label among those of its branch, two cells further in."""

    def __init__(self, names: Iterable[str]) -> None:
        labels: dict[str, dict[str, None]] = {}
        for name in names:
            above = ""
            for label in name.lstrip("/").split("/"):
                labels.setdefault(above, {})[label] = None
                above = f"{above}/{label}"
        self._labels = {above: NamesShown(each) for above, each in labels.items()}

    @cached_property
    def longest(self) -> int:
        """How many cells the longest line takes."""
        return max((_indent(above) + COUNTED + each.longest for above, each in self._labels.items()), default=0)

    @cached_property
    def readable(self) -> int:
        """In how many cells labels are told apart, and whole unless long: below other branches are others like them."""
        return max(
            (_indent(above) + max(each.readable, min(each.longest, WHOLE)) for above, each in self._labels.items()),
            default=0,
        )

    def fitted(self, name: str, width: int, count: str = "") -> str:
        """Return the label of a name, an element's or a branch's, as `NamesShown` does."""
        above, _, label = f"/{name.lstrip('/')}".rpartition("/")
        return self._labels[above].fitted(label, width, count)


class Told(NamedTuple):
    """Names that are told apart, below the namespace `space` that those that are shown share: it stands in the head."""

    space: str
    names: NamesShown | NamesInTree

    def fitted(self, name: str, width: int, count: str = "") -> str:
        """Return a name as it fits, a tree's last level alone; with how many entries it has where that has room."""
        return self.names.fitted(inside(self.space, name), width, count)


def _indent(above: str) -> int:
    return 2 * (above.count("/") + 1)


@lru_cache(maxsize=32)
def among(names: tuple[str, ...]) -> NamesShown:
    """Return names that are shown together, made once while they are the same."""
    return NamesShown(names)


@lru_cache(maxsize=4)
def in_tree(names: tuple[str, ...]) -> NamesInTree:
    """Return names that a tree shows, made once while they are the same."""
    return NamesInTree(names)


def _unique(parts: Collection[str]) -> dict[str, int]:
    """Return how many letters each begins with that no other has, none where there is no other."""
    ordered = sorted(parts)  # only its neighbours begin as long with the same letters
    common = [-1, *map(_common, ordered, ordered[1:]), -1]
    return {part: min(len(part), 1 + max(common[at : at + 2])) for at, part in enumerate(ordered)}


def _common(one: str, other: str) -> int:
    return next((at for at, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), len(one))


def _last_word(parts: Sequence[str]) -> int:
    return next((at for at in reversed(range(len(parts))) if _is_word(parts[at])), len(parts) - 1)


def _is_word(part: str) -> bool:
    return part[0].isalnum()


def _told(parts: Sequence[str], kept: Mapping[int, Kept]) -> list[int]:
    """Return which words tell a name apart, the shortest first."""
    return sorted((at for at in kept if any(kept[at]) and _is_word(parts[at])), key=lambda at: len(parts[at]))


def _wishes(parts: Sequence[str], kept: Mapping[int, Kept]) -> Iterator[tuple[Sequence[int], int, int]]:
    """Yield what a name has beside what tells it apart, what it needs most first, as `_grown` takes it.

    A few letters are read as a whole word: of one that tells nothing some begin the last level, or the name, alone.
    """
    words, levels, whole = _told(parts, kept), [list[int]()], list(map(len, parts))
    for at in reversed(range(len(parts))):
        if _is_word(parts[at]):
            levels[-1].append(at)
        elif "/" in parts[at]:
            levels.append([])
    yield from (([at], min(LEAST_HEAD, whole[at]), 1) for at in words if kept[at][1] < TAIL)
    slashes = [at for at in kept if "/" in parts[at] and {at - 1, at + 1} & set(words)]
    yield from (([at], whole[at], 1) for at in (*slashes, *words))
    yield from (([at], whole[at], min(LEAST_HEAD, whole[at])) for at in levels[0][-1:])  # it tells most
    for level in sorted(levels, key=lambda level: not set(level) & set(words)):
        yield from ((level[:count], whole[level[0]], whole[level[0]]) for count in range(1, len(level) + 1))


def _grown(
    parts: Sequence[str], kept: dict[int, Kept], ats: Sequence[int], letters: int, least: int, width: int
) -> dict[int, Kept]:
    """Return what is kept with so many letters of a part, or as many (`least` or more) as have room, others whole."""
    at, *others = ats
    head, tail = kept[at]
    beside = kept | {each: (len(parts[each]), 0) for each in others}
    most = min(letters, head + 1 + width - cells(_written(parts, kept)))  # one stands where a sign did
    grown = (beside | {at: (more, tail)} for more in range(most, max(head, least) - 1, -1))
    return next((each for each in grown if cells(_written(parts, each)) <= width), kept)


def _written(parts: Sequence[str], kept: Mapping[int, Kept]) -> str:
    """Return what is kept of a name, a sign for the letters that are left out where they take more than that."""
    words = left_out = ""
    for at, part in enumerate(parts):
        head, tail = kept[at][0], max(kept[at][0], len(part) - kept[at][1])
        for piece, middle in ((part[:head], part[head:tail]), (part[tail:], "")):
            if piece:
                words += (left_out if cells(left_out) <= len(MARK) else MARK) + piece
                left_out = ""
            left_out += middle
    return words + (left_out if cells(left_out) <= len(MARK) else MARK)


def _last(words: str, width: int) -> str:
    """Return the end of words that have no room."""
    if cells(words) <= width:
        return words
    while cells(words) >= width:
        words = words[1:]
    return MARK + words


def cut_words(words: str, width: int) -> str:
    """Return as many whole words as have room in so many cells, an ellipsis in place of the rest."""
    if cells(words) <= width:
        return words
    whole = words[: max(0, width - 1)]
    end = whole.rfind(" ") if words[len(whole) : len(whole) + 1].strip() else len(whole)
    return (whole[:end].rstrip(" :") if whole[:end].strip() else whole) + "…"
