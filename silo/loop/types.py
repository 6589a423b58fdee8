"""From a value to named scalar entries: suffixes as the original names them, and the registry for custom types.

A type is described by its parts; parts have parts of their own, so that a registered type works inside dataclasses,
lists and other registered types without a further word.
"""

import dataclasses
import enum
import functools
import keyword
import math
import numbers
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core import kinds
from silo.core.arguments import INT64, shown, text, whole
from silo.core.arrays.values import is_without_unit
from silo.core.calls import told
from silo.core.elements import Entry
from silo.errors import ElementError, SiloError, SourceError
from silo.loop.sources import PathStep, Reference, Source, can_refer, express, read_steps, refer

MAX_ENTRIES = 1_000_000
KEPT_BYTES = 512  # of a source whose scalars are remembered: 10,000 elements have few layouts


class Scalar(msgspec.Struct, frozen=True, gc=False):  # of a picture there are a million: nobody looks through them
    """One scalar of a source: `offset` in bytes from the source's first item (negative with negative strides)."""

    suffix: str
    dtype: np.dtype[Any]
    offset: int


@dataclass(frozen=True)
class Component:
    """A source with the suffix of its entries within the element."""

    suffix: str
    source: Source
    kind: str = ""
    labels: Mapping[int, str] | None = None

    def scalars(self, strides: tuple[int, ...]) -> tuple[Scalar, ...]:
        """The part's scalars when its source's items lie at these strides."""
        dtype, shape = self.source.dtype, self.source.shape
        scalars_of = _few_scalars if self.is_small else _scalars
        return scalars_of(dtype, shape, strides, self.kind, self.suffix)

    def entries(self) -> tuple[Entry, ...]:
        """How the part's scalars stand in tables and files, in their order."""
        return self._entries

    @functools.cached_property
    def _entries(self) -> tuple[Entry, ...]:
        if self.labels or not self.is_small:
            return tuple(entry_of(scalar, self.labels) for scalar in self.scalars(strides_of(self.source)))
        return _few_entries(self.source.dtype, self.source.shape, self.kind, self.suffix)

    @property
    def is_small(self) -> bool:
        """Whether what follows from type and shape may be remembered."""
        return self.source.nbytes <= KEPT_BYTES


def entry_of(scalar: Scalar, labels: Mapping[int, str] | None) -> Entry:
    """How a scalar stands in tables and files."""
    return Entry(scalar.suffix, _word_of(scalar.dtype), dict(labels) if labels and scalar.dtype.kind in "iu" else None)


@functools.lru_cache(maxsize=1024)
def _word_of(dtype: np.dtype[Any]) -> str:
    word: str = dtype.newbyteorder("<").str
    return word


def _scalars(
    dtype: np.dtype[Any], shape: tuple[int, ...], strides: tuple[int, ...], kind: str, suffix: str
) -> tuple[Scalar, ...]:
    return tuple(
        Scalar(suffix + one.suffix, one.dtype, one.offset) if suffix else one
        for one in expand(dtype, shape, strides, kind)
    )


_few_scalars = functools.lru_cache(maxsize=1024)(_scalars)


@functools.lru_cache(maxsize=1024)
def _few_entries(dtype: np.dtype[Any], shape: tuple[int, ...], kind: str, suffix: str) -> tuple[Entry, ...]:
    return tuple(entry_of(scalar, None) for scalar in _few_scalars(dtype, shape, (0,) * len(shape), kind, suffix))


# ---------------------------------------------------------------------------------------------- arrays to scalars


def expand(dtype: np.dtype[Any], shape: tuple[int, ...], strides: tuple[int, ...], kind: str) -> list[Scalar]:
    """All scalars of an array, in the order of the file. Raises ElementError where the kind doesn't fit the shape."""
    if dtype.subdtype is not None:
        base, inner = dtype.subdtype
        inner_strides = tuple(base.itemsize * math.prod(inner[axis + 1 :]) for axis in range(len(inner)))
        return expand(base, shape + inner, strides + inner_strides, kind)
    if math.prod(shape) > MAX_ENTRIES:
        raise ElementError(f"an array of shape {shape} has more than {MAX_ENTRIES} values; log a part of it")
    suffixes = _suffixes(dtype, shape, kind)
    scalars = _item_scalars(dtype) if suffixes else []
    items = zip(suffixes, offsets_of(shape, strides).tolist(), strict=True)
    return [Scalar(suffix + one.suffix, one.dtype, offset + one.offset) for suffix, offset in items for one in scalars]


def offsets_of(shape: tuple[int, ...], strides: tuple[int, ...]) -> NDArray[np.int64]:
    """Where the items of an array lie, in C order: bytes from the first."""
    offsets = np.zeros(1, np.int64)
    for size, step in zip(shape, strides, strict=True):
        offsets = (offsets[:, None] + step * np.arange(size)).reshape(-1)
    return offsets


def _item_scalars(dtype: np.dtype[Any]) -> list[Scalar]:
    if dtype.fields is not None:
        fields = [(name, dtype.fields[name][0], dtype.fields[name][1]) for name in dtype.names or ()]
        return [
            Scalar(f"_{name}{inner.suffix}", inner.dtype, int(offset) + inner.offset)
            for name, field, offset in fields
            for inner in expand(field, (), (), "")
        ]
    if dtype.kind == "V":
        raise ElementError(f"dtype {dtype} is bytes without a meaning; log it as numbers: x.view('u1')")
    if is_without_unit(dtype):
        raise ElementError(f"dtype {dtype} is a time without a unit; write dtype='{dtype.kind}8[ns]'")
    if dtype.kind == "c":
        half = np.dtype(f"{dtype.byteorder}f{dtype.itemsize // 2}")
        real, imaginary = kinds.COMPLEX.suffixes
        return [Scalar(real, half, 0), Scalar(imaginary, half, half.itemsize)]
    return [Scalar("", dtype, 0)]


def _suffixes(dtype: np.dtype[Any], shape: tuple[int, ...], kind: str) -> list[str]:
    """How the items of an array are called, in C order."""
    given = kinds.kind_given(kind or _kind_of_numbers(dtype, shape))
    if given is None:
        return kinds.index_suffixes(shape)
    layout = given[1]
    if not shape or shape[-1] != len(layout):
        raise ElementError(f"kind {kind!r} has {len(layout)} values in its last dimension, the shape is {shape}")
    return [f"{head}{suffix}" for head in _suffixes(dtype, shape[:-1], kinds.ARRAY.name) for suffix in layout]


def _kind_of_numbers(dtype: np.dtype[Any], shape: tuple[int, ...]) -> str:
    return kinds.VECTOR.name if shape == kinds.VECTOR.shape and dtype.kind in "fiu" else kinds.ARRAY.name


@functools.lru_cache(maxsize=1024)
def kind_of(dtype: np.dtype[Any], shape: tuple[int, ...], kind: str) -> str:
    """What the table and files say of how the entries belong together."""
    given = kinds.kind_given(kind)
    if given is not None:
        return given[0].name
    if dtype.fields is not None:
        return kinds.STRUCT.name
    if dtype.kind == "c" and shape == ():
        return kinds.COMPLEX.name
    if kind == "" and _kind_of_numbers(dtype, shape) == kinds.VECTOR.name:
        return kinds.VECTOR.name
    return kinds.kind_by_shape(shape).name


# --------------------------------------------------------------------------------------------------- custom types


@dataclass(frozen=True)
class _Registered:
    fields: tuple[str, ...]
    computed: Mapping[str, Callable[[Any], object]]
    kinds: Mapping[str, str]


_registry: dict[type, _Registered] = {}


@told("silo.register")
def register(
    cls: type, *fields: str, kinds: Mapping[str, str] | None = None, **computed: Callable[[Any], object]
) -> None:
    """Teach silo to log a type: the names of its attributes, and functions for what isn't an attribute.

    Each becomes a part named `_<field>`, read each due tick, so that assigning to an attribute is followed. Parts may
    be numbers, strings, enums, arrays, dataclasses, containers and other registered types. Subclasses are logged like
    their base.

    >>> class Circle:
    ...     def __init__(self) -> None:
    ...         self.diameter, self.center = 1.0, np.zeros(2)
    >>> register(Circle, "diameter", "center", area=lambda circle: np.pi * circle.diameter**2 / 4)

    Args:
        cls: the type.
        *fields: names of attributes; dotted paths go deeper.
        kinds: the kind of a field (`quaternion`, `pose`, ...).
        **computed: functions of an object, by the name of the part.

    Raises:
        ElementError: it is no class, a name is none, or nothing is named.
    """
    if not isinstance(cls, type):
        raise ElementError(
            f"register takes a class first, got {shown(cls)}; write silo.register({type(cls).__name__}, 'field', ...)"
        )
    call = f"register({cls.__name__})"
    if not fields and not computed:
        raise ElementError(f"{call}: name at least one attribute or function")
    for field in fields:
        _check_path(field)
    twice = [name for name, count in Counter([*fields, *computed]).items() if count > 1]
    if twice:
        raise ElementError(f"{call}: '{twice[0]}' is there twice; give each part a name of its own")
    for name, function in computed.items():
        if not callable(function):
            raise ElementError(
                f"{call}: {name} must be a function of the object, got {shown(function)}; "
                f"write {name}=lambda one: ..., or '{name}' for an attribute"
            )
    _registry[cls] = _Registered(fields, computed, _field_kinds(call, kinds, [*fields, *computed]))


def _field_kinds(call: str, given: Mapping[str, str] | None, fields: list[str]) -> Mapping[str, str]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ElementError(f"{call}: kinds must be a dict, got {shown(given)}; write kinds={{'field': 'quaternion'}}")
    for field, kind in given.items():
        if field not in fields:
            raise ElementError(f"{call}: kinds names {shown(field)}, which is none of {', '.join(fields)}")
        kinds.kind_given(text(f"{call}: the kind of '{field}'", kind, "'quaternion'"))
    return dict(given)


def _check_path(path: str) -> None:
    text("an attribute", path, "its name, or a dotted path like 'arm.q'")
    if not all(piece.isidentifier() and not keyword.iskeyword(piece) for piece in path.split(".")):
        raise ElementError(f"attribute {path!r}: write the name of an attribute, or a dotted path like 'arm.q'")


def _registered(value: object) -> _Registered | None:
    found = next((_registry[base] for base in type(value).__mro__ if base in _registry), None) if _registry else None
    if found is None and dataclasses.is_dataclass(value) and not isinstance(value, type):
        kinds = {f.name: f.metadata["kind"] for f in dataclasses.fields(value) if "kind" in f.metadata}
        return _Registered(tuple(f.name for f in dataclasses.fields(value)), {}, kinds)
    return found


def describe(
    value: object, name: str, *, attr: str | None, kind: str, labels: Mapping[int, str] | None, string_bytes: int | None
) -> list[Component]:
    """The parts of what was given to `add`. Raises SourceError or ElementError, naming the element."""
    if isinstance(value, type) and attr is None:
        raise SourceError(
            f"{name}: {value.__name__} is a class, not a variable: log an object of it, or an attribute by attr=..."
        )
    try:
        if attr is not None:
            _check_path(attr)
            steps = tuple(PathStep(attr=piece) for piece in attr.split("."))
            parts = _describe(value, steps, "", name, kind, string_bytes)
        elif callable(value) and _registered(value) is None and not can_refer(value):
            parts = _describe(value, (PathStep(call=True),), "", name, kind, string_bytes)
        else:
            parts = _describe(value, (), "", name, kind, string_bytes)
        _check_suffixes(parts)
    except ElementError as error:
        raise ElementError(f"element '{name}': {error}") from None
    except SiloError:
        raise
    except RecursionError:
        raise SourceError(
            f"{name}: {type(value).__name__} holds itself, or is nested too deeply; log its parts one by one"
        ) from None
    except Exception as error:  # what stands in the program's own properties, keys and interfaces
        raise SourceError(
            f"{name}: looking into {type(value).__name__} failed ({type(error).__name__}: {error})"
        ) from error
    if labels:
        parts = [dataclasses.replace(part, labels=labels) for part in parts]
    if not parts:
        raise SourceError(f"{name}: {type(value).__name__} has no values to log")
    return parts


def _check_suffixes(parts: list[Component]) -> None:
    if len(parts) == 1 and parts[0].is_small:
        _check_few_suffixes(parts[0].source.dtype, parts[0].source.shape, parts[0].kind, parts[0].suffix)
    else:
        _check_distinct([entry.suffix for one in parts for entry in one.entries()])


@functools.lru_cache(maxsize=1024)
def _check_few_suffixes(dtype: np.dtype[Any], shape: tuple[int, ...], kind: str, suffix: str) -> None:
    _check_distinct([entry.suffix for entry in _few_entries(dtype, shape, kind, suffix)])


def _check_distinct(suffixes: list[str]) -> None:
    for suffix, count in Counter(suffixes).items():
        if count > 1:
            raise ElementError(f"{count} of its values are named '...{suffix}' all alike; rename a field or key")
        if not suffix.isprintable():
            raise ElementError(f"the name of a value, {suffix!r}, holds a control character; rename the key")


def _describe(
    root: object, steps: tuple[PathStep, ...], suffix: str, name: str, kind: str, string_bytes: int | None
) -> list[Component]:
    """Parts of the value that `steps` lead to. What can be reached without a step is logged by reference."""
    try:
        value = read_steps(root, steps)
    except Exception as error:
        raise SourceError(
            f"{name}: reading {''.join(map(str, steps))} failed ({type(error).__name__}: {error})"
        ) from error

    def inside(step: tuple[PathStep, ...], part: str, part_kind: str = "") -> list[Component]:
        return _describe(root, steps + step, f"{suffix}_{part}", name, part_kind, string_bytes)

    registered = _registered(value)
    if registered is not None:
        parts = [
            part
            for field in registered.fields
            for part in inside(
                tuple(PathStep(attr=piece) for piece in field.split(".")),
                field.replace(".", "_"),
                registered.kinds.get(field, ""),
            )
        ]
        for field, function in registered.computed.items():
            reader = _Computed(root, steps, function)
            parts += _describe(
                reader, (PathStep(call=True),), f"{suffix}_{field}", name, registered.kinds.get(field, ""), string_bytes
            )
        return parts
    if isinstance(value, dict) and value:
        return [part for key in value for part in inside((PathStep(key=key),), str(key))]
    if isinstance(value, list | tuple) and value and not _is_plain(value):
        if hasattr(value, "_fields"):
            return [part for i, field in enumerate(value._fields) for part in inside((PathStep(key=i),), field)]
        if not steps and all(can_refer(item) for item in value):
            return [Component(f"{suffix}_{i}", refer(item, name), kind) for i, item in enumerate(value)]
        return [part for i in range(len(value)) for part in inside((PathStep(key=i),), str(i))]
    if not steps:
        return [Component(suffix, refer(value, name), kind)]
    made = express(root, steps, value, name, string_bytes=string_bytes)
    return [Component(suffix, made, kind, made.labels)]


@dataclass(frozen=True)
class _Computed:
    """A registered function bound to its object, which is looked up anew each time."""

    root: object
    steps: tuple[PathStep, ...]
    function: Callable[[Any], object]

    def __call__(self) -> object:
        return self.function(read_steps(self.root, self.steps))


def _is_plain(items: list[object] | tuple[object, ...]) -> bool:
    """Whether a list holds plain values, which only an expression can follow."""
    return all(isinstance(item, bool | int | float | complex | str | bytes | np.generic | enum.Enum) for item in items)


def as_numbers(name: str, value: object) -> NDArray[Any]:
    """Return a number as float64, an array or tensor as an array of NumPy. Raises SourceError for anything else."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool | np.generic):
        return np.array(value, np.float64)
    for step in ("detach", "cpu"):  # of torch: what has a gradient, or lies on a GPU, is no array yet
        value = getattr(value, step, lambda now=value: now)()
    try:
        plain = not hasattr(value, "__array__") and hasattr(value, "__dlpack__")
        found = np.from_dlpack(value) if plain else np.asarray(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, RuntimeError, BufferError) as error:
        raise SourceError(f"log.value({name!r}, ...): NumPy makes no array of it ({error})") from None
    if found.dtype.kind not in "biufc":
        raise SourceError(
            f"log.value({name!r}, ...) takes numbers and arrays of numbers, got a {type(value).__name__}; texts and "
            f"enumerations are read where they stand: log.add(robot, attr={name!r})"
        )
    return found


def label_map(labels: type[enum.Enum] | Mapping[int, str] | None) -> Mapping[int, str] | None:
    """Names of the values of an integer element, from an enumeration or a mapping. Raises ElementError."""
    if labels is None:
        return None
    if isinstance(labels, type) and issubclass(labels, enum.Enum):
        if not all(isinstance(member.value, int) for member in labels):
            raise ElementError(
                f"labels={labels.__name__}: the values of its members aren't integers; give a dict: {{0: 'name', ...}}"
            )
        labels = {int(member.value): member.name for member in labels}
    if not isinstance(labels, Mapping):
        raise ElementError(
            f"labels must be an enumeration or a dict from numbers to names, got {shown(labels)}; "
            "write labels={0: 'stand', 1: 'walk'}"
        )
    return {
        whole("a number in labels", number, *INT64): text(f"the label of {number}", label, "labels={0: 'stand'}")
        for number, label in labels.items()
    }


def strides_of(source: Source) -> tuple[int, ...]:
    """Byte strides of a source; an expression is stored in C order."""
    return (source.view if isinstance(source, Reference) else np.empty(source.shape, source.dtype)).strides
