"""Wrong calls, told in the words of the caller: an argument that isn't there, one too many, one that is missing.

`told` stands over the functions and classes that programs call. It costs a call 0.1 us and nothing else; `collect()` is
left out. Type checkers see the signatures as they are.
"""

import inspect
import logging
from collections.abc import Callable, Container, Iterable, Mapping
from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any, Concatenate, NoReturn, ParamSpec, TypeVar, cast

import msgspec

from silo.core.arguments import shown
from silo.core.names import did_you_mean, nearest
from silo.errors import ArgumentError, UnknownNameError

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

log = logging.getLogger("silo")

# what options of elements were called, and are now: the former is still taken, and the latter told once
FORMER_WORDS = {"buffer_type": "buffer", "buffer_size": "size"}
_told_words: set[str] = set()

# what people call an argument, by what it is called here; of several, the first that the function has
SYNONYMS = {
    "frequency": ("freq", "hz", "rate", "frequencyhz", "samplerate", "fs", "dt", "timestep", "period", "ts"),
    "divider": ("decimation", "every", "rate", "freq", "frequency", "hz"),
    "max_time": ("duration", "maxlogtime", "maxloggingtime", "seconds", "maxtimes"),
    "size": ("buffersize", "length", "capacity", "samples", "bufsize"),
    "buffer": ("buffertype", "buf", "mode"),
    "action": ("act", "publish", "logaction"),
    "enabled": ("on", "log", "logging", "enable", "active"),
    "description": ("desc", "doc", "help", "comment"),
    "kind": ("type",),
    "types": ("type", "filetype", "filetypes", "format", "formats", "ending"),
    "folder": ("path", "dir", "directory", "outdir", "collectpath"),
    "name": ("filename", "title", "log"),
    "group": ("namespace", "ns", "prefix"),
    "prefix": ("namespace", "ns", "group"),
    "script": ("config", "yaml", "file", "scriptfilename"),
    "source": ("var", "variable", "value", "array", "data"),
    "timeout_s": ("timeout",),
    "times": ("hz", "rate", "freq", "frequency", "dt", "fs"),
    "start_s": ("start", "begin", "t0", "tmin"),
    "stop_s": ("stop", "end", "t1", "tmax"),
    "dtype": ("type",),
    "bounds": (
        "low",
        "high",
        "min",
        "max",
        "lower",
        "upper",
        "warn",
        "alarm",
        "yellow",
        "red",
        "limit",
        "limits",
        "range",
    ),
    "string_bytes": ("strlen", "stringlength", "maxlength"),
}
EXAMPLES = {
    "frequency": "frequency=500 (ticks per second: 1 / dt)",
    "divider": 'divider=2 (every second tick) or divider="50Hz"',
    "size": 'size=1000 or "10s"',
    "bounds": "bounds=(None, None, 80, 95) (red low, yellow low, yellow high, red high)",
}


def present_word(word: str) -> str:
    """What this is called now; of a word of before it is said once that the next release won't know it any more."""
    new = FORMER_WORDS.get(word, word)
    if new != word:
        tell_former(word, f"is called {new} now: write {new}=...")
    return new


def tell_former(word: str, way: str) -> None:
    """Say once of a word of before what to write; the next release refuses it."""
    if word not in _told_words:
        _told_words.add(word)
        log.warning("%s %s; the next release will refuse %s", word, way, word)


def present_words(options: Mapping[str, Any], known: Container[str]) -> dict[str, Any]:
    """Keywords by what they are called now, where that is known and not given, too."""

    def word(key: str) -> str:
        new = FORMER_WORDS.get(key, key)
        return present_word(key) if new in known and new not in options else key

    return {word(key): value for key, value in options.items()}


def told(label: str, bound: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function raise ArgumentError for a wrong call. `label` is how it is called: `log.add`.

    bound: its first argument is the object, or the class, that the caller doesn't write.
    """

    def wrapped(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                return function(*args, **kwargs)
            except TypeError as error:
                # raised within the function, it has passed through more than this frame
                if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                    raise
                present: Any = present_words(kwargs, inspect.signature(function).parameters)
                if present != kwargs:
                    return call(*args, **present)
                raise ArgumentError(call_problem(label, function, args, kwargs, bound) or str(error)) from None

        return call

    return wrapped


def told_class(
    label: str, make: str = "", leave: Iterable[str] = (), shared: type = object, returns: object = None
) -> Callable[[C], C]:
    """Put `told` over all public methods of a class, and over making one if that is written `make`.

    `shared` is a base that it has in common with others; its methods tell `help()` that they return `returns` here.
    """

    def wrapped(cls: C) -> C:
        done: dict[object, object] = {}  # an alias stays the same function
        for name, found in list(vars(cls).items()):
            if name in leave or (name.startswith("_") and not (make and name == "__init__")):
                continue
            shown = make if name == "__init__" else f"{label}.{name}"
            if inspect.isfunction(found):
                setattr(cls, name, done.setdefault(found, told(shown, bound=True)(found)))
            elif isinstance(found, classmethod):
                setattr(cls, name, classmethod(told(f"{cls.__name__}.{name}", bound=True)(found.__func__)))
        for name, found in vars(shared).items():
            if inspect.isfunction(found) and not name.startswith("_"):
                call = told(f"{label}.{name}", bound=True)(found)
                vars(call)["__signature__"] = inspect.signature(found).replace(return_annotation=returns)
                setattr(cls, name, call)
        return cls

    return wrapped


class ToldStruct(msgspec.StructMeta):
    """The class of structs that programs make: a wrong call is told of as one of `told` is. Decoding isn't slower.

    Making one costs 0.7 us more.
    """

    if not TYPE_CHECKING:  # which take the call for that of the struct: with this one, any arguments would do

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: D102, N805  # of a class of classes
            try:
                return super().__call__(*args, **kwargs)
            except TypeError as error:
                present = present_words(kwargs, cls.__struct_fields__)
                if present != kwargs:
                    return cls(*args, **present)
                label = f"silo.{cls.__name__}"
                unknown = [key for key in kwargs if key not in cls.__struct_fields__]
                if unknown:  # no example: a struct takes numbers alone
                    problem = unknown_argument(label, unknown[0], cls.__struct_fields__, {})
                else:
                    problem = call_problem(label, cls, args, kwargs)
                raise ArgumentError(problem or f"{label}(): {error}") from None


def call_problem(
    label: str, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any], bound: bool = False
) -> str:
    """What is wrong in a call, empty if nothing is."""
    parameters = list(inspect.signature(function).parameters.values())
    if bound:
        parameters, args = parameters[1:], args[1:]
    keywords = [p.name for p in parameters if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)]
    by_place = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    others = any(p.kind is p.VAR_KEYWORD for p in parameters)
    for key in kwargs:
        if key not in keywords and not others:
            return unknown_argument(label, key, keywords)
    taken = by_place[: len(args)]
    twice = next((name for name in taken if name in kwargs), "")
    if twice:
        return f"{label}() got {twice!r} twice, by its place and by its name; nothing was done"
    missing = [p.name for p in parameters if p.default is p.empty and p.name in keywords]
    missing = [name for name in missing if name not in taken and name not in kwargs]
    if missing:
        # the names of required arguments come first in each signature
        return f"{label}() needs {' and '.join(missing)}: write {label}({', '.join(_usage(parameters))})"
    if len(args) > len(by_place) and not any(p.kind is p.VAR_POSITIONAL for p in parameters):
        left = [name for name in keywords if name not in by_place and name not in kwargs]
        way_out = f"; name the others: {left[0]}={shown(args[len(by_place)])}" if left else ""
        if others:
            way_out = "; name the others: divider=5, action='publish'"
        listed = f" ({', '.join(by_place)})" if by_place else ""
        most = f"{len(by_place) or 'no'} argument{'' if len(by_place) == 1 else 's'}"
        return f"{label}() takes {most} by place{listed}, got {len(args)}{way_out}; nothing was done"
    return ""


def unknown_argument(label: str, key: str, known: Iterable[str], examples: Mapping[str, str] = EXAMPLES) -> str:
    """The message for an argument that a function lacks, with what was meant."""
    known = list(known)
    if not known:
        return f"{label}() takes no arguments, got {key!r}; nothing was done"
    found = _meant(key, known)
    if found:
        example = f": write {examples[found]}" if found in examples else ""
        return f"{label}() has no argument {key!r}, did you mean {found!r}?{example}; nothing was done"
    return f"{label}() has no argument {key!r}, it takes {', '.join(known)}; nothing was done"


def unknown_word(what: str, value: object, words: list[str]) -> str:
    """The message for a word that there isn't, with the one that was meant."""
    hint = did_you_mean(nearest(value.lower(), words) if isinstance(value, str) else ())
    return f"there is no {what} {shown(value)}; there are {', '.join(words)}{hint}"


def no_attribute(what: str, name: str, cls: type, others: Mapping[str, str], way_out: str = "") -> NoReturn:
    """Raise UnknownNameError for an attribute that an object lacks, with what does it.

    Args:
        what: the object in words: `a logger`.
        name: what was asked for.
        cls: the object's class.
        others: what people call things, with what to write instead.
        way_out: what to write if neither they nor a similar name tell.
    """
    found = others.get(name, "")
    if not found and not name.startswith("_"):
        known = (*dir(cls), *getattr(cls, "__dataclass_fields__", ()), *getattr(cls, "__struct_fields__", ()))
        found = did_you_mean(nearest(name, [one for one in known if not one.startswith("_")], 0.7))[2:]
    public = (
        f"{home}.{one.__name__}"
        for one in cls.__mro__
        for home in ("silo", "silo.types")
        if getattr(import_module(home), one.__name__, None) is one
    )
    home = next(public, f"{cls.__module__}.{cls.__name__}")
    found = found or way_out or f"help({home}) lists what there is"
    raise UnknownNameError(f"{what} has no '{name}': {found}", name=name)


def told_names(
    what: str, others: Mapping[str, str] | None = None, way_out: str = "", *, fixed: str = ""
) -> Callable[[C], C]:
    """Have the objects of a class tell of attributes that they lack, as `no_attribute` does.

    fixed: what to write instead of setting or deleting an attribute of one that stays as it is.
    """

    def missing(self: object, name: str) -> NoReturn:
        no_attribute(what, name, type(self), others or {}, way_out)

    def keeping(self: object, name: str, value: object = None) -> NoReturn:
        raise UnknownNameError(f"{what} keeps its .{name}: {fixed}; nothing was changed", name=name)

    def wrapped(cls: C) -> C:
        if "__getattr__" not in vars(cls):
            setattr(cls, "__getattr__", missing)  # noqa: B010  # type checkers know which names there are
        if fixed:
            setattr(cls, "__setattr__", keeping)  # noqa: B010
            setattr(cls, "__delattr__", keeping)  # noqa: B010
        return cls

    return wrapped


def _meant(key: str, known: list[str]) -> str:
    plain = {_plain(name): name for name in known}
    asked = _plain(key)
    if asked in plain:  # bufferSize, buffersize, BUFFER_SIZE
        return plain[asked]
    synonym = next((name for name, words in SYNONYMS.items() if asked in words and name in known), "")
    near = [] if synonym else nearest(asked, plain)
    return synonym or (plain[near[0]] if near else "")


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _usage(parameters: list[inspect.Parameter]) -> list[str]:
    usage = [p.name for p in parameters if p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD]
    optional = [f"{p.name}=..." for p in parameters if p.default is not p.empty]
    return [*usage, *optional[:3], *(["..."] if len(optional) > 3 else [])]


def of(part: str, method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """Return a method that is one of an object's part: `add = of("_scripted", ScriptedTable.add)`.

    Type checkers see the part's signature, `help()` and the reference its docstring; a wrong call is told of there.

    Args:
        part: the attribute that holds the part.
        method: of the part's class.
    """

    @wraps(method)
    def call(self: object, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(getattr(self, part), *args, **kwargs)

    return cast(Callable[Concatenate[Any, P], R], call)
