"""Every file format that silo writes or reads: one row each, from which everybody else takes what he needs to know.

Saving, converting, opening, the names of logs, the help and completion of the shell commands and the terminal's
dialogs ask here; a new format is a row, a module with its functions, and its test. Readers and writers are named as
texts and imported when they are used: this module loads neither NumPy nor any format.
"""

import contextlib
import enum
import re
from collections.abc import Callable, Iterable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from silo.core.arguments import shown
from silo.core.elements import FileType
from silo.core.names import did_you_mean, nearest
from silo.core.quantities.writing import and_more
from silo.errors import ElementError, FileFormatError, LogNotFoundError, SaveError

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from silo.core.recording import Progress, Recording

    Writer = Callable[..., None]  # recording, path, progress; and options of its format
    Reader = Callable[[Path], Recording]


class OtherFormats(Protocol):
    """What reads and writes files that silo can't, and what would if it weren't broken: `silo.files.added`."""

    @property
    def left_out(self) -> tuple[str, ...]: ...  # noqa: D102

    def reader(self, path: Path) -> "Reader | None": ...  # noqa: D102

    def writer(self, path: Path) -> "Writer | None": ...  # noqa: D102


Added = Callable[[], OtherFormats]


class Keeps(enum.Flag):
    """What a file of a format still says of a recording when it is read again. Values and time stamps always."""

    NOTHING = 0
    DTYPES = enum.auto()  # every entry has the type that it was logged with
    BITS = enum.auto()  # values are the same to the last bit: which NaN it was, bytes that are no text
    KINDS = enum.auto()  # which entries were one element, its kind, shape and the fields of a struct
    UNITS = enum.auto()
    LABELS = enum.auto()  # names of an enumeration's values
    DESCRIPTIONS = enum.auto()
    BUFFERS = enum.auto()  # buffer type, how many samples were lost, at which ticks a source could not be read
    ABOUT = enum.auto()  # of the log: logger, prefix, frequency, ticks since start, wall clock at start, warnings
    EMPTY = enum.auto()  # elements without a sample
    LONG = enum.auto()  # all digits of long doubles
    ALL = LONG | DTYPES | BITS | KINDS | UNITS | LABELS | DESCRIPTIONS | BUFFERS | ABOUT | EMPTY


class Format(msgspec.Struct, frozen=True):
    """One format. `writer` and `reader` are `module:function`, empty where it is only read or only written.

    endings: the first is what silo gives to new files; all are understood. folder: a log is a folder, not a file.
    saved_as: its number in the save request, for formats that a logger saves in. about: a few words for dialogs.
    extra: which extra of the package has the libraries that writing needs. mark: the first bytes of every file.
    beside: what is added to the name for a second file, without which next to nothing is kept. own_times: whether each
    element may have time stamps of its own. checks: whether its reader takes `check=True`.
    """

    name: str
    endings: tuple[str, ...]
    about: str
    writer: str = ""
    keeps: Keeps = Keeps.NOTHING
    reader: str = ""
    own_times: bool = False
    folder: bool = False
    saved_as: FileType | None = None
    extra: str = ""
    mark: bytes = b""
    beside: str = ""
    checks: bool = False

    @property
    def ending(self) -> str:
        """The ending of new files."""
        return self.endings[0]

    @property
    def shown(self) -> str:
        """The format in a list of endings."""
        return f"{self.ending} (a folder; {', '.join(self.endings[1:])}, too)" if self.folder else self.ending

    @property
    def for_logs(self) -> bool:
        """Whether loggers and recorders write it; all else is what logs are converted to."""
        return bool(self.writer) and (self.saved_as is not None or bool(self.mark))

    def load_writer(self) -> "Writer":
        """The function that writes a recording with its derived signals: `write(recording, path, progress)`."""
        function = _function(self.writer)

        def write(recording: "Recording", path: Path, progress: "Progress | None", **options: Any) -> None:
            from silo.core.recording import falls, has_own_stamps, read_whole, silent

            if not self.own_times and has_own_stamps(recording):
                whose = "in this bag each topic" if recording.stretch is None else "an element changed by a cut"
                if falls(recording.time_ns):
                    whose = "an element across a step back of the clock"
                elif recording.stretch is not None and recording.stretch.recorder:
                    whose = "an element with a gap between two parts of the recording, or changed by a cut,"
                raise SaveError(
                    f"'{path}' has one time for all signals, but {whose} has its own: choose a rate, "
                    f"log.resample(100).save({path.name!r}) or `silo convert --rate 100`; "
                    f"{_list([one.ending for one in FORMATS if one.own_times and one.writer])} keep the times of each"
                )
            read_whole(recording)
            if recording.conditions.derived:
                from silo.expressions.derived_samples import with_derived_samples

                recording = with_derived_samples(recording)
            # of logs it is told when they are read again; in tables stands all that other tools may want to know
            whole = recording if self.for_logs else _clock_told(with_rounding_told(recording, self))
            function(whole, path, progress=progress or silent, **options)

        return write

    def load_reader(self, *, check: bool = False) -> "Reader":
        """The function that reads a file or folder of this format, with `check` and the checksums of its values."""
        read = _function(self.reader)
        return partial(read, check=True) if check and self.checks else read


# In the order of preference: of one save in several formats, the first is the one that is opened.
FORMATS = (
    Format(
        name="silo",
        endings=(".silo",),
        about="binary; the readers of silo",
        writer="silo.files.silo.writer:write_silo",
        reader="silo.files.silo.reader:read_silo",
        keeps=Keeps.ALL & ~Keeps.EMPTY,
        saved_as=FileType.SILO,
        mark=b"#  ---",
        checks=True,
    ),
    Format(
        name="mcap",
        endings=(".mcap",),
        about="one MCAP file: Foxglove",
        writer="silo.files.bags.writer:write_bag",
        reader="silo.files.bag_reader:open_bag",
        keeps=Keeps.ALL,
        mark=b"\x89MCAP",
        checks=True,
    ),
    Format(
        name="bag",
        # not ".bag" for new ones: readers like AnyReader of rosbags take what ends so for a bag of ROS 1
        endings=(".rosbag2", ".bag"),
        about="rosbag2 with MCAP: ros2 bag, Foxglove",
        writer="silo.files.bags.writer:write_bag",
        reader="silo.files.bag_reader:open_bag",
        keeps=Keeps.ALL,
        folder=True,
        saved_as=FileType.BAG,
        checks=True,
    ),
    Format(
        name="csv",
        endings=(".csv",),
        about="one column per signal",
        writer="silo.files.csv.writer:write_csv",
        reader="silo.files.csv.reader:read_csv",
        keeps=Keeps.ALL & ~Keeps.BITS & ~Keeps.EMPTY,
        saved_as=FileType.CSV,
        beside=".json",
    ),
    Format(
        name="parquet",
        endings=(".parquet",),
        about="Apache Parquet: pandas, polars, DuckDB",
        writer="silo.files.tables.parquet:write_parquet",
        reader="silo.files.tables.parquet:read_parquet",
        keeps=Keeps.ALL & ~Keeps.BITS & ~Keeps.LONG,
        extra="convert",
    ),
    Format(
        name="matlab",
        endings=(".mat",),
        about="MATLAB, Octave",
        writer="silo.files.tables.arrays:write_mat",
        reader="silo.files.tables.arrays:read_mat",
        keeps=Keeps.ALL & ~Keeps.BITS & ~Keeps.LONG,
        own_times=True,
        extra="convert",
    ),
    Format(
        name="numpy",
        endings=(".npz",),
        about="NumPy arrays",
        writer="silo.files.tables.arrays:write_npz",
        reader="silo.files.tables.arrays:read_npz",
        keeps=Keeps.ALL,
        own_times=True,
    ),
    Format(
        name="hdf5",
        endings=(".h5", ".hdf5"),
        about="HDF5",
        writer="silo.files.tables.arrays:write_hdf5",
        reader="silo.files.tables.arrays:read_hdf5",
        keeps=Keeps.ALL,
        own_times=True,
        extra="convert",
    ),
    Format(
        name="rerun",
        endings=(".rrd",),
        about="Rerun",
        writer="silo.files.tables.rrd:write_rrd",
        own_times=True,
        extra="rerun",
    ),
    Format(
        name="ulog",
        endings=(".ulg",),
        about="ULog of PX4",
        reader="silo.files.others.ulog_file:read_ulog",
        own_times=True,
        extra="bags",
        mark=b"ULog",
    ),
)
MOST_MARK_BYTES = 32
SQLITE_ENDING = ".db3"  # a file of rosbag2's other storage, which is read and not written
FOLDER = next(one for one in FORMATS if one.folder)  # what a name without ending becomes
SAVED = {kind: one for kind in FileType for one in FORMATS if one.saved_as is kind}
SAVED_NAMES = tuple(one.name for one in SAVED.values())
# of everything that can be opened, in the order of preference
OPEN_PART_ENDING = ".mcap.part"  # of a recording, while it is written or after a kill: it can be read
# what loggers and recorders write: what else lies among logs may be a table of anybody, and is opened by its name
LOG_ENDINGS = tuple(ending for one in FORMATS if one.for_logs for ending in one.endings)


def file_type(name: str) -> FileType | None:
    """The number under which a format is saved, by its name or ending in any case; None if there is no such format."""
    word = name.lower().removeprefix(".")
    return next((kind for kind, one in SAVED.items() if word == one.name), None)


def file_types(given: object, call: str = "log.save") -> list[FileType]:
    """Return the file types to save in, each once, as somebody named them in a `call`. Raises ElementError."""
    if isinstance(given, str | bytes | bool) or not isinstance(given, Iterable):
        given = [given]
    return list(dict.fromkeys(_file_type(one, call) for one in given))


def _file_type(given: object, call: str) -> FileType:
    found = given if isinstance(given, FileType) else file_type(given) if isinstance(given, str) else None
    if found is None:
        raise ElementError(f"unknown file type {shown(given)}; there are {savable()}{_type_hint(given, call)}")
    return found


def _type_hint(given: object, call: str) -> str:
    if not isinstance(given, str):
        return ""
    word = given.strip().lower()
    if word == "binary":
        return did_you_mean(["silo"])
    several = [part.strip() for part in re.split("[,; +]+", word) if part.strip()]
    if len(several) > 1 and all(file_type(part) is not None for part in several):
        return f"; write {several}"
    if "." in word.lstrip("."):
        return f"; the name is an argument of its own: {call}('csv', name={Path(given).stem!r})"
    other = next((one for one in FORMATS if word.removeprefix(".") in (one.name, one.ending[1:])), None)
    if other is not None:
        return f"; silo.open_log(...).save('run{other.ending}') or `silo convert` writes {other.ending} from those"
    return did_you_mean(nearest(word, SAVED_NAMES))


def kind_of(path: "str | os.PathLike[str]") -> FileType | None:
    """The number under which the format of a file's ending is saved, None for one that isn't saved in."""
    found = format_of(path)
    return found.saved_as if found is not None else None


def format_of(path: "str | os.PathLike[str]") -> Format | None:
    """The format that the ending of a name means, None for an ending that no format has."""
    ending = Path(path).suffix.lower()
    return FOLDER if not ending else next((one for one in FORMATS if ending in one.endings), None)


def writer_for(path: Path, added: Added | None = None) -> "Writer":
    """The function that writes files of this ending, by `added` also one of another package.

    Raises `SaveError` for an ending that nothing writes.
    """
    found = format_of(path)
    word = next((one for one in FORMATS if path.name.lower() in (one.name, one.ending[1:])), None)
    if word is not None and word.writer and word is not found:  # `bag` alone is a folder, as bags are
        raise SaveError(f"'{path}' says the format alone: write the file's name before it, 'run{word.ending}'")
    if found is not None and found.writer:
        return found.load_writer()
    others = added() if added is not None else None
    if others is not None and (write := others.writer(path)) is not None:
        return write
    left_out = "".join(f"; {words}" for words in (others.left_out if others is not None else ()))
    raise SaveError(f"'{path}': silo can't write {path.suffix.lower()}, only {writable()}{left_out}")


def read_recording(path: "str | os.PathLike[str]", added: Added | None = None, *, check: bool = False) -> "Recording":
    """Open any file that silo reads; one with an unknown ending by its first bytes. `added` gives readers of others.

    With `check` all values are held against the checksums of the file where it has some for values that are read later.
    Raises `LogNotFoundError` or `FileFormatError`.
    """
    source, left_out = Path(path), ""
    if not source.exists():
        raise LogNotFoundError(f"there is no file or folder '{source}'")
    if not source.is_dir() and not source.is_file():
        # a pipe would be waited for without end
        raise FileFormatError(
            f"'{source}' is a pipe or a device, which can't be read as a log; write it to a file first"
        )
    if source.is_dir():
        if not is_bag_folder(source):
            raise FileFormatError(f"'{source}' is a folder without a bag in it")
        return _as_read(FOLDER.load_reader()(source))
    found = format_of(source) if source.suffix else None
    own = found is not None and found.reader and not found.folder
    if added is not None and not own and source.suffix != SQLITE_ENDING and by_mark(source) is None:
        others = added()
        if (read := others.reader(source)) is not None:
            return _as_read(read(source))
        left_out = "".join(f"; {words}" for words in others.left_out)
    refuse_others(source)
    if source.suffix == SQLITE_ENDING:
        found = FOLDER
    elif found is None:
        found = by_mark(source)
    elif found.folder:
        # a single file that is called like a bag folder
        found = by_mark(source) or found
    if found is None or not found.reader:
        ending = source.suffix.lower() or "files without ending"
        raise FileFormatError(f"'{source}': silo doesn't read {ending}, only {readable()}{left_out}")
    try:
        return _as_read(found.load_reader(check=check)(source))
    except MemoryError:
        raise FileFormatError(
            f"'{source}' takes more memory than there is ({source.stat().st_size:,} bytes); convert it to .silo where "
            "there is more: that is read in parts"
        ) from None


ROS1_MARK = b"#ROSBAG V"


def refuse_others(path: Path) -> None:
    """Raise FileFormatError for what people take for a log, by its first bytes, with the way to one."""
    if starts_with(path, b"version https://git-lfs"):
        raise FileFormatError(f"'{path}' is a pointer of Git LFS, not the file itself; fetch it: `git lfs pull`")


def starts_with(path: Path, mark: bytes) -> bool:
    """Whether a file begins with these bytes; one that can't be opened doesn't."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(len(mark)) == mark
    return False


def _as_read(recording: "Recording") -> "Recording":
    from silo.core.recording import with_stretch

    return _clock_told(with_stretch(recording))


def _clock_told(recording: "Recording") -> "Recording":
    """The recording, with a warning where its clock stepped back."""
    from dataclasses import replace

    import numpy as np

    back = np.flatnonzero(np.diff(recording.time_ns) < 0)
    if not len(back):
        return recording
    at_s = (int(recording.time_ns[back[0]]) - int(recording.time_ns[0])) * 1e-9
    step_s = (int(recording.time_ns[back[0]]) - int(recording.time_ns[back[0] + 1])) * 1e-9
    times = "once" if len(back) == 1 else f"{len(back)} times"
    words = (
        f"the clock stepped back {times}, first by {step_s:.3g} s at {at_s:.6g} s: some times are there twice, and "
        "samples are in the order in which they were collected (clock=time.monotonic_ns never steps back)"
    )
    if words in recording.warnings:  # a copy, which was told so when it was written
        return recording
    if isinstance(recording.warnings, list):  # of a bag: what is found later, when values are read, is added to it
        recording.warnings.append(words)
        return recording
    return replace(recording, warnings=(*recording.warnings, words))


def with_rounding_told(recording: "Recording", one: Format | None) -> "Recording":
    """The recording, which is read whole for that, with a warning where a format rounds long doubles of it."""
    if one is None or Keeps.LONG in one.keeps:
        return recording
    from dataclasses import replace

    import numpy as np

    from silo.core.recording import read_whole

    def is_rounded(values: "NDArray[Any]") -> bool:
        narrow = {"f": np.float64, "c": np.complex128}.get(values.dtype.kind)
        if narrow is None or values.dtype.itemsize <= np.dtype(narrow).itemsize:
            return False
        with np.errstate(over="ignore", invalid="ignore"):
            kept = values.astype(narrow)
        return bool(((kept != values) & ~np.isnan(values)).any())

    read_whole(recording)
    names = [element.name for element in recording.elements if any(is_rounded(one.values) for one in element.entries)]
    if not names:
        return recording
    whole = _list([each.ending for each in FORMATS if each.writer and Keeps.LONG in each.keeps])
    words = f"{and_more(names, 3)}: long doubles are rounded to 53 bits, as {one.ending} has none ({whole} keep them)"
    return replace(recording, warnings=tuple(dict.fromkeys((*recording.warnings, words))))


def means_log(word: str) -> bool:
    """Whether a word is a run number, a file that is there, or has the ending of a file that silo reads or writes."""
    endings = (*(ending for one in FORMATS for ending in one.endings), OPEN_PART_ENDING, SQLITE_ENDING)
    path = Path(word)
    return word.isdecimal() or word.lower().endswith(endings) or (path.is_file() and bool(path.suffix))


def is_bag_folder(path: Path) -> bool:
    """Whether this is a folder with a rosbag2 recording, of silo or of others, not one with logs in it.

    A recorder that was killed has left no `metadata.yaml`; then it must be the only log there.
    """
    if not path.is_dir():
        return False
    if (path / "metadata.yaml").is_file():
        return True
    logs = [one.suffix for one in path.iterdir() if one.suffix in (*LOG_ENDINGS, SQLITE_ENDING)]
    return logs in ([".mcap"], [SQLITE_ENDING])


def savable() -> str:
    """The names of the formats that a logger saves in, as a list in words."""
    return _list(list(SAVED_NAMES))


def readable() -> str:
    """The endings that silo reads, as a list in words."""
    return _list([one.ending if not one.folder else "a bag folder" for one in FORMATS if one.reader])


def writable() -> str:
    """The endings that silo writes, as a list in words."""
    return _list([one.shown for one in FORMATS if one.writer])


def by_mark(path: Path, formats: Iterable[Format] = FORMATS) -> Format | None:
    """The format that the first bytes of a file mean, None where they mean none of these."""
    try:
        with path.open("rb") as file:
            start = file.read(MOST_MARK_BYTES)
    except OSError:
        # the reader will say why
        return None
    return next((one for one in formats if one.mark and start.startswith(one.mark)), None)


def _function(text: str) -> Callable[..., Any]:
    module, _, name = text.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), name)
    return found


def _list(words: list[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}"
