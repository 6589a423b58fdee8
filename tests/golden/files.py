"""One recording with something of everything, and what each format makes of it: text or bytes that can be compared."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from silo.core.conditions import CaptureFacts, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import BufferType, Entry, LoggedEvent
from silo.core.recording import NO_FAILURES, Failures, RecordedElement, RecordedEntry, Recording
from silo.files.formats import writer_for

START_NS, STEP_NS, TICKS = 1_700_000_000_123_456_789, 2_500_001, 12
EXACT = (".silo", ".csv")  # the same bytes each time; the others are compressed by libraries that change


def recording() -> Recording:
    """Twelve ticks: numbers of several types, a vector, an enumeration, text, a struct, times, what was lost."""
    odd = np.array([np.nan, np.inf, -np.inf, -0.0, 5e-324, np.finfo(float).max])
    made = [
        one("/log/q", "rad", [("", "<f8", np.linspace(-1, 1, TICKS) ** 3)], description="angle of the knee"),
        one("/log/tau", "Nm", [(f"_{k}", "<f4", np.arange(6) * (k + 0.1)) for k in range(3)], (3,), divider=2),
        one("/log/count", "-", [("", "<i8", 2**60 + np.arange(4))], buffer=BufferType.LOOPING, first=8),
        one("/log/flags", "-", [("", "<u8", np.array([0, 1, 2**64 - 1], "<u8"))], buffer=BufferType.FIXED),
        one("/log/ok", "-", [("", "|b1", np.arange(TICKS) % 3 == 0)]),
        one(
            "/log/odd",
            "m/s²",
            [("", "<f8", odd)],
            divider=2,
        ),
        one("/log/mode", "-", [("", "<i4", np.arange(TICKS) % 2, {0: "STANCE", 1: "SWING, fast"})]),
        one("/log/text", "-", [("", "|S6", np.array([f"a {k}é".encode() for k in range(TICKS)], "|S6"))]),
        one("/log/when", "-", [("", "<M8[ns]", (START_NS + np.arange(TICKS)).astype("<M8[ns]"))]),
        one(
            "/log/wave",
            "V",
            [("_real", "<f8", np.cos(np.arange(TICKS))), ("_imag", "<f8", np.sin(np.arange(TICKS)))],
        ),
        one(
            "/log/base",
            "m",
            [(f"_{name}", "<f8", np.arange(TICKS) + k) for k, name in enumerate("xyz")],
            (3,),
            "position",
        ),
        one(
            "/log/part",
            "-",
            [("_a", "<f8", np.arange(3.0)), ("_b", "|i1", np.arange(3))],
            dtype="[('a', '<f8'), ('b', '|i1')]",
            kind="struct",
            divider=4,
        ),
        one("/log/lossy", "A", [("", "<f8", np.arange(5.0))], lost=7, failures=Failures(2, ((3, 3), (5, 5)))),
    ]
    conditions = Conditions(
        (Derived("/log/effort", "norm(tau)", "Nm"),),
        (SignalLimits("/log/q", bounds=(-0.9, None, 0.5, 0.9), persistence=2, hysteresis=0.05),),
        (TriggerOptions("fall", "q > 0.5", 0.01, 0.01),),
        CaptureFacts("fall", 3, 2, 9, (5,), (START_NS + 5 * STEP_NS,)),
    )
    events = (
        LoggedEvent("started", "started by anna", START_NS, 0, START_NS, "anna@lab", "run1", 1),
        LoggedEvent("marker", 'push, "hard" é', START_NS + 9, 4, START_NS + 4 * STEP_NS, "robot", "run1", 2),
    )
    stamps = START_NS + np.arange(TICKS, dtype=np.int64) * STEP_NS
    return Recording(
        "anymal",
        stamps,
        20,
        made,
        frequency_hz=400.0,
        started_ns=START_NS - 5,
        time_looping=True,
        warnings=("memory limit reached",),
        why="trigger fall",
        conditions=conditions,
        events=events,
    )


def one(
    name: str,
    unit: str,
    entries: list[tuple],
    shape: tuple[int, ...] = (),
    kind: str = "",
    *,
    divider: int = 1,
    buffer: BufferType = BufferType.GROWING,
    first: int = 0,
    description: str = "",
    lost: int = 0,
    dtype: str = "",
    failures: Failures = NO_FAILURES,
) -> RecordedElement:
    """An element of entries `(suffix, dtype, values[, labels])`."""
    made = tuple(
        RecordedEntry(f"{name}{suffix}", Entry(suffix, kind_of, *labels), np.asarray(values).astype(kind_of))
        for suffix, kind_of, values, *labels in entries
    )
    kind = kind or ("array" if shape or len(made) > 1 else "scalar")
    return RecordedElement(name, unit, kind, shape, divider, buffer, first, made, description, lost, dtype, failures)


def written() -> dict[str, bytes]:
    """Write it in every format into the working directory; by file name what is compared.

    A `.silo` tells the path that it was written to, hence the working directory.
    """
    found: dict[str, bytes] = {}
    for ending in EXACT:
        writer_for(Path(f"run{ending}"))(recording(), Path(f"run{ending}"), None)
    for path in sorted(Path().glob("run.*")):
        found[path.name] = path.read_bytes()
    for ending, told in TOLD.items():
        path = Path(f"told{ending}")
        writer_for(path)(recording(), path, None)
        found[f"run{ending}.txt"] = "".join(f"{line}\n" for line in told(path)).encode()
    return found


def of_mcap(path: Path) -> list[str]:
    """Every record but those that say where others stand."""
    from mcap.reader import make_reader

    lines = []
    with path.open("rb") as file:
        reader = make_reader(file)
        header = reader.get_header()
        lines.append(f"header {header.profile}")
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            lines.append(
                f"{channel.topic} {schema.name} {message.log_time} {message.publish_time} {message.data.hex()}"
            )
        summary = reader.get_summary()
        lines += [f"schema {one.name} {one.encoding} {text(one.data)}" for one in summary.schemas.values()]
        lines += [f"channel {one.topic} {one.message_encoding} {one.metadata}" for one in summary.channels.values()]
        lines += [f"attachment {one.name} {one.media_type} {text(one.data)}" for one in reader.iter_attachments()]
        lines += [f"metadata {one.name} {one.metadata}" for one in reader.iter_metadata()]
    return sorted(lines)


def of_bag(path: Path) -> list[str]:
    """The metadata, but for its file's name, which says nothing."""
    return (path / "metadata.yaml").read_text().splitlines()


def of_npz(path: Path) -> list[str]:
    """Each array."""
    with np.load(path) as file:
        return [array_line(name, file[name]) for name in sorted(file.files)]


def of_mat(path: Path) -> list[str]:
    """Each variable, structs by their fields."""
    from scipy.io import loadmat

    found = loadmat(path, simplify_cells=True)
    return sorted(line for name, value in found.items() if not name.startswith("__") for line in nested(name, value))


def of_hdf5(path: Path) -> list[str]:
    """Each data set with its attributes."""
    import h5py

    lines = []
    with h5py.File(path) as file:
        file.visititems(lambda name, one: lines.extend(h5_lines(name, one)))
        lines += [f"@{name} {value}" for name, value in file.attrs.items()]
    return sorted(lines)


def h5_lines(name: str, one: object) -> list[str]:
    """What stands at a name."""
    lines = [f"{name}@{key} {value}" for key, value in one.attrs.items()]
    return [*lines, array_line(name, np.asarray(one[()]))] if hasattr(one, "dtype") else lines


def of_parquet(path: Path) -> list[str]:
    """Each column, with the metadata of the table and of the column."""
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path)
    lines = [f"{key.decode()} {value.decode()}" for key, value in (table.schema.metadata or {}).items()]
    for field in table.schema:
        told = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
        column = table[field.name]
        values = column.cast("int64") if str(field.type).startswith("timestamp") else column
        lines.append(f"{field.name} {field.type} {told} {values.to_pylist()}")
    return lines


TOLD: dict[str, Callable[[Path], list[str]]] = {
    ".mcap": of_mcap,
    ".rosbag2": of_bag,
    ".npz": of_npz,
    ".mat": of_mat,
    ".h5": of_hdf5,
    ".parquet": of_parquet,
}


def nested(name: str, value: object) -> list[str]:
    """A struct of MATLAB, field by field."""
    if isinstance(value, dict):
        return [line for key, inner in value.items() for line in nested(f"{name}.{key}", inner)]
    return [array_line(name, np.asarray(value))]


def array_line(name: str, values: np.ndarray) -> str:
    """An array in a line: exact where it is short, else by its sum."""
    shown = values.tolist() if values.size <= 40 else hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return f"{name} {values.dtype} {values.shape} {shown!r}"


def text(data: bytes) -> str:
    """Bytes as a line of text."""
    return repr(data.decode("utf-8", "backslashreplace"))
