"""Kinds of elements: how the numbers of a vector, a quaternion or a pose are called, sent, and put together again.

One entry of `KINDS` per kind. The collecting side asks it for the suffixes of a variable's scalars, the bag writer for
the ROS message, and readers of files that say nothing of kinds (CSV, files of the original) which entries belong
together. Suffixes are those of the original. Knows neither NumPy nor any format.
"""

import math
import re
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import msgspec

from silo.core.arguments import line, shown
from silo.core.calls import told
from silo.core.names import did_you_mean, nearest
from silo.decoding import converted, json_decoder
from silo.errors import ElementError

_XYZ = ("_x", "_y", "_z")
_XYZW = ("_x", "_y", "_z", "_w")
_WXYZ = ("_w", "_x", "_y", "_z")
_POSE = (*(f"_position{axis}" for axis in _XYZ), *(f"_orientation{axis}" for axis in _XYZW))
_TWIST = (*(f"_linear{axis}" for axis in _XYZ), *(f"_angular{axis}" for axis in _XYZ))
_ANGLE_AXIS = ("_angle", *_XYZ)


class EntryGroup(msgspec.Struct, frozen=True):
    """Entries `start ... start + len(suffixes)` are one element of this name, kind and shape."""

    name: str
    kind: str
    shape: tuple[int, ...]
    start: int
    suffixes: tuple[str, ...]


class GeometryMessage(msgspec.Struct, frozen=True):
    """A message of ROS' `geometry_msgs`: `<name>Stamped` with the value in `field`; `fields` are the value's own."""

    name: str
    field: str
    fields: tuple[tuple[str, str], ...]


Found = tuple[str, tuple[int, ...], tuple[str, ...]]  # name, shape and suffixes of an element


class Kind(msgspec.Struct, frozen=True):
    """What is to know of one kind.

    suffixes: of the values in the last dimension, in the order of the ROS message's numbers; empty where they are
    indices. shape: of an element that is put together again. orders: names under which `add` takes the kind, each with
    the suffixes as they lie in memory, and so in files: what comes back is what was logged, number by number.
    read_name: for kinds with parameters, name -> suffixes, None for another kind. message: the ROS message for floats.
    array: without one, the numbers travel as one array, its lengths before it under the names `sizes`. find: the
    element that begins at a place in a list of names.
    """

    name: str
    suffixes: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    orders: Mapping[str, tuple[str, ...]] = {}
    shown: str = ""
    read_name: Callable[[str], tuple[str, ...] | None] | None = None
    message: GeometryMessage | None = None
    array: bool = False
    sizes: tuple[str, ...] = ()
    find: Callable[[Sequence[str], int], Found | None] | None = None

    def found_at(self, names: Sequence[str], place: int) -> Found | None:
        """The element of this kind that begins at this place, None if there is none."""
        if self.find is not None:
            return self.find(names, place)
        for suffixes in self.orders.values():
            found = _with_suffixes(names, place, suffixes, self.shape)
            if found is not None:
                return found
        return None


def _with_suffixes(names: Sequence[str], place: int, suffixes: tuple[str, ...], shape: tuple[int, ...]) -> Found | None:
    first = names[place]
    base = first.removesuffix(suffixes[0])
    if base in ("", first) or not _follows(names, place, base, suffixes):
        return None
    return base, shape, suffixes


def _follows(names: Sequence[str], place: int, base: str, suffixes: Sequence[str]) -> bool:
    return list(names[place : place + len(suffixes)]) == [base + suffix for suffix in suffixes]


# ------------------------------------------------------------------------------------- a vector at a position, matrices

_AT_POSITION_NAME = re.compile(r"vector_at_position\((?P<vector>[^,]*),(?P<position>[^,]*)\)")
_AT_POSITION = re.compile(r"(?P<base>.+?)_vector_in_(?P<frame>.+)_frame_x")
_COMPONENTS = re.compile(r"components\((?P<names>\s*[A-Za-z]\w*\s*(,\s*[A-Za-z]\w*\s*)*)\)")
_CELL = re.compile(r"(?P<base>.+)_0_0")
_FIRST = re.compile(r"(?P<base>.+)_0")


@told("silo.types.vector_at_position")
def vector_at_position(vector_frame: str, position_frame: str) -> str:
    """Return the kind of six numbers: a vector in one frame, and the position in another frame where it acts.

    Args:
        vector_frame: the vector's frame.
        position_frame: the position's frame.

    Raises:
        ElementError: a name is empty or holds a comma or bracket.
    """
    for frame in (vector_frame, position_frame):
        given = line("a frame's name", frame, "silo.types.vector_at_position('world', 'base')").strip()
        if not given or any(letter in given for letter in ",()"):
            raise ElementError(f"a frame's name must not be empty nor hold commas or brackets, got {shown(frame)}")
    return _at_position_kind(vector_frame, position_frame)


def _at_position_kind(vector_frame: str, position_frame: str) -> str:
    return f"vector_at_position({vector_frame}, {position_frame})"


def _at_position_suffixes(name: str) -> tuple[str, ...] | None:
    match = _AT_POSITION_NAME.fullmatch(name)
    if match is None:
        return None
    vector, position = match["vector"].strip(), match["position"].strip()
    return (
        *(f"_vector_in_{vector}_frame{axis}" for axis in _XYZ),
        *(f"_at_position_in_{position}_frame{axis}" for axis in _XYZ),
    )


def _component_suffixes(name: str) -> tuple[str, ...] | None:
    match = _COMPONENTS.fullmatch(name)
    return None if match is None else tuple(f"_{one.strip()}" for one in match["names"].split(","))


def _find_at_position(names: Sequence[str], place: int) -> Found | None:
    match = _AT_POSITION.fullmatch(names[place])
    if match is None or place + 6 > len(names):
        return None
    base = match["base"]
    at = re.fullmatch(re.escape(base) + r"_at_position_in_(.+)_frame_x", names[place + 3])
    suffixes = _at_position_suffixes(_at_position_kind(match["frame"], at[1])) if at else None
    return (base, (6,), suffixes) if suffixes and _follows(names, place, base, suffixes) else None


def _find_matrix(names: Sequence[str], place: int) -> Found | None:
    match = _CELL.fullmatch(names[place])
    if match is None:
        return None
    base = match["base"]
    columns = 1
    while place + columns < len(names) and names[place + columns] == f"{base}_0_{columns}":
        columns += 1
    rows = 1
    while _follows(names, place + rows * columns, base, [f"_{rows}_{c}" for c in range(columns)]):
        rows += 1
    if rows == 1 or columns == 1:
        return None
    return base, (rows, columns), tuple(f"_{r}_{c}" for r in range(rows) for c in range(columns))


def _find_indices(names: Sequence[str], place: int) -> Found | None:
    match = _FIRST.fullmatch(names[place])
    if match is None:
        return None
    base = match["base"]
    length = 1
    while place + length < len(names) and names[place + length] == f"{base}_{length}":
        length += 1
    return None if length == 1 else (base, (length,), tuple(f"_{i}" for i in range(length)))


def _find_vector(names: Sequence[str], place: int) -> Found | None:
    return _with_suffixes(names, place, _XYZ, (3,)) or _find_indices(names, place)


# ------------------------------------------------------------------------------------------------------------ the kinds

SCALAR = Kind("scalar")
VECTOR = Kind(
    "vector",
    suffixes=_XYZ,
    shape=(3,),
    orders={"vector": _XYZ},
    message=GeometryMessage("Vector3", "vector", (("float64", "x"), ("float64", "y"), ("float64", "z"))),
    array=True,
    find=_find_vector,
)
ARRAY = Kind("array", shown="components(NAME, NAME, ...)", read_name=_component_suffixes, array=True)
MATRIX = Kind("matrix", array=True, sizes=("rows", "cols"), find=_find_matrix)
COMPLEX = Kind("complex", suffixes=("_real", "_imag"))
STRUCT = Kind("struct")

# Where several fit the names of entries, the first is taken: the longer ones come before the vector.
KINDS = (
    Kind(
        "quaternion",
        suffixes=_XYZW,
        shape=(4,),
        orders={"quaternion": _XYZW, "quaternion_wxyz": _WXYZ},
        message=GeometryMessage(
            "Quaternion",
            "quaternion",
            (("float64", "x"), ("float64", "y"), ("float64", "z"), ("float64", "w")),
        ),
    ),
    Kind(
        "pose",
        suffixes=_POSE,
        shape=(7,),
        orders={"pose": _POSE},
        message=GeometryMessage(
            "Pose", "pose", (("geometry_msgs/Point", "position"), ("geometry_msgs/Quaternion", "orientation"))
        ),
    ),
    Kind(
        "twist",
        suffixes=_TWIST,
        shape=(6,),
        orders={"twist": _TWIST},
        message=GeometryMessage(
            "Twist", "twist", (("geometry_msgs/Vector3", "linear"), ("geometry_msgs/Vector3", "angular"))
        ),
    ),
    Kind(
        "vector_at_position",
        shape=(6,),
        shown="vector_at_position(FRAME, FRAME)",
        read_name=_at_position_suffixes,
        find=_find_at_position,
    ),
    Kind("angle_axis", suffixes=_ANGLE_AXIS, shape=(4,), orders={"angle_axis": _ANGLE_AXIS}),
    MATRIX,
    VECTOR,
    COMPLEX,
    ARRAY,
    STRUCT,
    SCALAR,
)


def kind_named(name: str) -> Kind | None:
    """The kind that tables and files call so; None for one of a later silo."""
    return next((kind for kind in KINDS if kind.name == name), None)


def kind_given(name: str) -> tuple[Kind, tuple[str, ...]] | None:
    """The kind that `add` is given by this name, and its suffixes in the order of memory, which files keep.

    None for `""` and `array`: plain indices. Raises `ElementError` for a name that no kind has.
    """
    if name in ("", ARRAY.name):
        return None
    for kind in KINDS:
        if name in kind.orders:
            return kind, kind.orders[name]
        suffixes = kind.read_name(name) if kind.read_name else None
        if suffixes is not None:
            return kind, suffixes
    hint = did_you_mean(nearest(name.lower(), given_names()))
    raise ElementError(f"unknown kind {shown(name)}; there are {', '.join(given_names())}{hint}")


def given_names() -> list[str]:
    """The names that `add` takes, as they are written."""
    named = [name for kind in KINDS for name in (*kind.orders, *([kind.shown] if kind.shown else []))]
    return [*named, ARRAY.name]


def kind_by_shape(shape: tuple[int, ...]) -> Kind:
    """The kind of plain numbers in this shape; dimensions of size 1 don't count."""
    return (SCALAR, ARRAY, MATRIX, ARRAY)[min(sum(size > 1 for size in shape), 3)]


def index_suffixes(shape: tuple[int, ...]) -> list[str]:
    """Suffixes of the items of an array in C order; a dimension of size 1 has none."""
    suffixes = [""]
    for size in shape:
        suffixes = [head + ("" if size == 1 else f"_{i}") for head in suffixes for i in range(size)]
    return suffixes


def is_complex(kind: str, shape: tuple[int, ...], suffixes: Sequence[str]) -> bool:
    """Whether the entries are real and imaginary parts in turns, two per item of the shape."""
    real, imaginary = COMPLEX.suffixes
    return (
        kind != STRUCT.name
        and len(suffixes) == 2 * math.prod(shape)
        and all(one.endswith(real) for one in suffixes[::2])
        and all(one.endswith(imaginary) for one in suffixes[1::2])
    )


def in_parts(kind: str, shape: tuple[int, ...] | None, entries: Sequence[Any]) -> bool:
    """Whether the entries of an element are parts of complex numbers as they were logged; without a shape, of any."""
    suffixes = [entry.suffix for entry in entries]
    floats = bool(entries) and entries[0].dtype[1:2] == "f"
    return floats and is_complex(kind, (len(suffixes) // 2,) if shape is None else tuple(shape), suffixes)


def struct_text(dtype: Any) -> str:
    """The fields of a NumPy structure as text, little-endian, without gaps between them; empty for any other type."""
    return msgspec.json.encode(_fields(dtype)).decode() if dtype.fields is not None else ""


def struct_fields(text: str) -> list[tuple[Any, ...]]:
    """What `numpy.dtype` takes, of a text of `struct_text`; empty where it is none."""
    try:
        return [_field(one) for one in json_decoder(list[tuple[str, Any, list[int]]]).decode(text)]
    except (msgspec.DecodeError, RecursionError):
        return []


def _fields(dtype: Any) -> Any:
    if dtype.fields is None:
        return dtype.newbyteorder("<").str
    parts = [(name, dtype.fields[name][0]) for name in dtype.names]
    return [(name, _fields(part.base), list(part.shape)) for name, part in parts]


def _field(one: tuple[str, Any, list[int]]) -> tuple[Any, ...]:
    name, kind, shape = one
    deeper = isinstance(kind, list)
    inner = [_field(converted(each, tuple[str, Any, list[int]])) for each in kind] if deeper else kind
    return name, inner, tuple(shape)


def regroup(names: Sequence[str], likeness: Sequence[Hashable]) -> list[EntryGroup]:
    """Groups that cover all entries in order; only neighbours of equal `likeness` (divider, type ...) are joined."""
    groups: list[EntryGroup] = []
    start = 0
    while start < len(names):
        stop = start + 1
        while stop < len(names) and likeness[stop] == likeness[start]:
            stop += 1
        run = names[start:stop]
        place = 0
        while place < len(run):
            group = _group_at(run, place, start)
            groups.append(group)
            place += len(group.suffixes)
        start = stop
    return groups


def _group_at(run: Sequence[str], place: int, start: int) -> EntryGroup:
    for kind in KINDS:
        found = kind.found_at(run, place)
        if found is not None:
            name, shape, suffixes = found
            return EntryGroup(name, kind.name, shape, start + place, suffixes)
    return EntryGroup(run[place], SCALAR.name, (), start + place, ("",))
