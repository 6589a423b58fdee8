"""Which elements a name means: one rule for programs, the shell, expressions, files, recordings and the terminal.

The first that finds something counts:

| written | means |
| --- | --- |
| `/log/joints/q` | the element, or the scalar, of this name |
| `joints/q`, `/joints/q` | that with the logger's prefix before it |
| `q`, `log/joints/q` | every name that ends so behind a `/` |
| `joints/q/x`, `joints/q[0]` | the scalar `joints/q_x`, `joints/q_0`, in bags of others `joints/q/x` |
| `forward` | every component of this name: `base/command_forward` |
| `joints` | what is in this namespace: a whole one, one behind the prefix, one anywhere |
| `*q`, `joints/*` | a glob (`*` crosses `/`), behind any `/` unless it begins with `/` or `*` |

Where one is asked for, several are an error that names them.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from fnmatch import translate
from functools import cached_property
from glob import escape
from typing import Any, TypeVar

GIVEN = "letters, digits, blanks and / _ - . +"  # of which a name is that is given while a logger runs
_GIVEN = re.compile(r"[\w /.+-]*[\w.+-][\w /.+-]*")
MOST_ALIKE = 20_000  # names that are looked through for what was meant: 0.2 s

Key = TypeVar("Key")
One = TypeVar("One")

Found = tuple[int, int | None]  # the place of an element, and of one of its scalars where that is meant


def in_order(found: Iterable[Found]) -> list[Found]:
    """Return what is meant in the order of the table, an element before its scalars."""
    return sorted(found, key=lambda one: (one[0], -1 if one[1] is None else one[1]))


class Names:
    """The names of elements; `scalars` gives those of the scalars of each, when they are first asked for."""

    def __init__(
        self, names: Iterable[str], prefix: str = "", scalars: Callable[[], Iterable[Sequence[str]]] | None = None
    ) -> None:
        self.names = list(names)
        self.places: dict[str, int] = {}
        for place, name in enumerate(self.names):
            self.places.setdefault(name, place)
        self.prefix = f"/{bare}" if (bare := prefix.strip("/")) else ""
        self._read_scalars = scalars

    @classmethod
    def of(cls, elements: Sequence[Any], prefix: str = "") -> "Names":
        """Return the names of elements, each with `name` and `entries`, and of their scalars."""
        every = (one.name for one in elements)
        return cls(every, prefix, lambda: [[one.name + each.suffix for each in one.entries] for one in elements])

    def keys(self, text: str) -> tuple[str, str]:
        """Return what a text may be the whole name of: itself, or with the prefix."""
        return text, f"{self.prefix}/{text.lstrip('/')}"

    def find(self, text: str, *, scalars: bool = False, namespaces: bool = True) -> list[Found]:
        """Return what a text means, in the order of the table; nothing for what there isn't."""
        return next((found for found in self._steps(text, scalars, namespaces) if found), [])

    def exact(self, name: str) -> Found | None:
        """Return what has this whole name: an element, or a scalar of one."""
        return (self.places[name], None) if name in self.places else self._scalars.get(name)

    def has(self, name: str) -> bool:
        """Whether something has this whole name."""
        return self.exact(name) is not None

    def every(self, text: str, *, scalars: bool = False) -> list[Found]:
        """Return what a text means by any of the rules, not by the first alone: what it meant to commands so far."""
        if text.startswith("/"):
            inside = self._inside((f"{text.rstrip('/')}/",))
            whole: list[Found] = [(self.places[text], None)] if text in self.places else []
            return [*whole, *inside] or self.find(text, scalars=scalars) or self.find(text.lstrip("/"), scalars=scalars)
        steps = self._steps(text, scalars, namespaces=True, spellings=False)
        found = {one for some in steps for one in some} or self.find(text, scalars=scalars)
        return in_order(found)

    def whole(self, glob: str) -> list[Found]:
        """Return the elements whose whole names match, with or without the prefix: so programs meant globs so far."""
        return self._matching([*self.keys(glob), f"/{glob.strip('/')}"])

    def part_of(self, text: str) -> list[Found]:
        """Return the elements in whose names a text stands anywhere, or else such scalars: so it meant to plots."""
        glob = [f"*{text}" if is_glob(text) else f"*{escape(text)}*"]
        return self._matching(glob) or self._matching(glob, self._scalars)

    def _steps(self, text: str, scalars: bool, namespaces: bool, *, spellings: bool = True) -> Iterable[list[Found]]:
        text = re.sub("/{2,}", "/", text)
        bare = text.strip("/")
        if not bare:
            yield self._matching(["*"]) if namespaces else []
            return
        # names of scalars may cost reading all of a log
        whole: list[Found] = [(self.places[key], None) for key in self.keys(text) if key in self.places]
        yield whole[:1]
        if scalars:
            yield [self._scalars[key] for key in self.keys(text) if key in self._scalars][:1]
        if not is_glob(text):
            yield self._ending(bare, scalars)
        if is_glob(text):
            globs = (text, f"{self.prefix or '*'}{text}") if text.startswith("/") else (text,)
            for glob in globs:
                anchored = glob if glob.startswith(("/", "*")) else f"*/{glob}"
                yield self._matching([anchored])
                if scalars:
                    yield self._matching([anchored], self._scalars)
                if namespaces:
                    yield self._matching([f"{anchored}/*"])
        if scalars and spellings:
            others = _other_spellings(text)
            yield [self._scalars[key] for other in others for key in self.keys(other) if key in self._scalars][:1]
            yield [one for other in others for one in self._ending(other.strip("/"), scalars)]
            yield self._components.get(bare, [])
        if namespaces and not is_glob(text):
            yield self._inside(tuple(f"{key.rstrip('/')}/" for key in self.keys(text)))
            yield [(place, None) for name, place in self.places.items() if f"/{bare}/" in name]

    def _ending(self, bare: str, scalars: bool) -> list[Found]:
        end, last = f"/{bare}", bare.rpartition("/")[2]
        found: list[Found] = [(self.places[name], None) for name in self._ends.get(last, ()) if name.endswith(end)]
        if scalars:
            found += [self._scalars[name] for name in self._scalar_ends.get(last, ()) if name.endswith(end)]
        return found

    def _inside(self, starts: tuple[str, ...]) -> list[Found]:
        return [(place, None) for name, place in self.places.items() if name.startswith(starts)]

    def _matching(self, globs: Sequence[str], among: dict[str, Found] | None = None) -> list[Found]:
        matches = re.compile("|".join(map(translate, globs))).match
        if among is not None:
            return [one for name, one in among.items() if matches(name)]
        return [(place, None) for name, place in self.places.items() if matches(name)]

    @cached_property
    def _ends(self) -> dict[str, list[str]]:
        return grouped((name.rpartition("/")[2], name) for name in self.places)

    @cached_property
    def _scalar_names(self) -> list[Sequence[str]]:
        return list(self._read_scalars()) if self._read_scalars else []

    @cached_property
    def _scalars(self) -> dict[str, Found]:
        """Scalars by name; those named as an element are that element."""
        found: dict[str, Found] = {}
        for place, names in enumerate(self._scalar_names):
            for number, name in enumerate(names):
                if name not in self.places:
                    found.setdefault(name, (place, number))
        return found

    @cached_property
    def _components(self) -> dict[str, list[Found]]:
        """Scalars by the names of components, where they have more than a number or an axis."""
        called = ((component_name(name.removeprefix(self.names[one[0]])), one) for name, one in self._scalars.items())
        return grouped((component, one) for component, one in called if is_word(component))

    @cached_property
    def _scalar_ends(self) -> dict[str, list[str]]:
        return grouped((name.rpartition("/")[2], name) for name in self._scalars)

    # ---------------------------------------------------------------------------------------------- what was meant

    def several(self, text: str, found: Sequence[Found]) -> str:
        """Return what is said where one is asked for, and a text means several."""
        there = [self.name(one) for one in found]
        more = f" and {len(there) - 3} more" if len(there) > 3 else ""
        return f"'{text}' may be {', '.join(there[:3])}{more}: write more of the name"

    def name(self, found: Found) -> str:
        """Return the whole name of what was found."""
        place, number = found
        return self.names[place] if number is None else self._scalar_names[place][number]

    def near(self, text: str, most: int = 3, *, scalars: bool = False, more: Iterable[str] = ()) -> list[str]:
        """Return the whole names that are most like one that there isn't."""
        # without the prefix, which would make all names alike
        known = [*self.places, *(self._scalars if scalars else ()), *more]
        shorts = {name.removeprefix(f"{self.prefix}/"): name for name in known[:MOST_ALIKE]}
        bare = text.removeprefix(f"{self.prefix}/").strip("/*")
        close = begun(list(shorts), bare)[:most] if len(bare) > 2 else []  # somebody did not type it to its end
        close = close or nearest(bare, shorts, most=most)
        close = close or [name for name in shorts if bare and bare.lower() in name.lower()][:most]
        return [shorts[name] for name in close]

    def hint(self, text: str, otherwise: str) -> str:
        """Return what is said behind an error of a name that there isn't."""
        glob = glob_of_regex(text)
        return did_you_mean([glob] if glob and self.find(glob) else self.near(text, 1), otherwise)


def nearest(asked: str, words: Iterable[str], cutoff: float = 0.6, most: int = 1) -> list[str]:
    """Return the words that are most like one that there isn't."""
    from difflib import get_close_matches  # who finds what is asked for doesn't load it

    return get_close_matches(asked, words, most, cutoff)


def did_you_mean(near: Iterable[str], otherwise: str = "") -> str:
    """Return what is said behind an error of a word that there isn't: what was meant, or else what there is."""
    words = ", ".join(f"'{one}'" for one in near)
    return f"; did you mean {words}?" if words else f"; {otherwise}" if otherwise else ""


def component_name(suffix: str) -> str:
    """Return what a component is called where it stands below its element: `forward`, `[3]`, `[0,1]`."""
    bare = suffix.removeprefix("_")
    return f"[{bare.replace('_', ',')}]" if bare and not bare.strip("_0123456789") else bare


def is_word(component: str) -> bool:
    """Return whether a component has a name that says which one it is; a number or an axis is that of many others."""
    return len(component) > 1 and not component.startswith("[")


def is_given(name: str) -> bool:
    """Return whether a name is one that may be given (`GIVEN`): no pattern, and no part of an expression."""
    return _GIVEN.fullmatch(name) is not None


def is_glob(text: str) -> bool:
    """Return whether a text is a pattern of names."""
    return any(letter in text for letter in "*?[")


def glob_of_regex(text: str) -> str:
    """Return what a regular expression is written as here, `*torque` for `torque$`; empty where it is none, or more."""
    starred = re.sub(r"\.[*+]", "*", text)
    glob = starred.removeprefix("^").removesuffix("$")
    if glob == text or not glob or any(sign in glob for sign in "^$\\+(){}"):
        return ""
    begin = "" if starred.startswith("^") or glob.startswith("*") else "*"
    return f"{begin}{glob}" + ("" if starred.endswith("$") or glob.endswith("*") else "*")


def matching(names: Sequence[str], patterns: Sequence[str], prefix: str = "") -> list[str]:
    """Return the names that patterns of a command or a recording mean; all without patterns."""
    if not patterns:
        return list(names)
    known = Names(names, prefix)
    chosen = {place for pattern in patterns for place, _ in known.every(pattern)}
    return [name for place, name in enumerate(names) if place in chosen]


def begun(names: Sequence[str], incomplete: str) -> list[str]:
    """Return the names that one being typed may become: those that begin so, else those that do behind a `/`."""
    whole = [name for name in names if name.startswith(incomplete)]
    return whole or [name for name in names if f"/{incomplete}" in name]


def _other_spellings(text: str) -> list[str]:
    """How else a scalar may be named: `q_x`, `q/x` and `q[x]` are the same one, `q_0_1` and `q[0,1]`."""
    stem, _, last = text.rpartition("/")
    front, _, end = text.rpartition("_")
    bare, bracket, number = text.removesuffix("]").partition("[")
    return [
        one
        for one in (
            stem and last and f"{stem}_{last}",
            front and end and f"{front}/{end}",
            bracket and f"{bare}_{number.replace(',', '_')}",
        )
        if one
    ]


def grouped(things: Iterable[tuple[Key, One]]) -> dict[Key, list[One]]:
    """Return things by their names, or whatever else they share, in the order in which they come."""
    found: dict[Key, list[One]] = {}
    for name, one in things:
        found.setdefault(name, []).append(one)
    return found
