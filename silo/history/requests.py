"""Samples: past ones as rows or columns, all from now on as a stream, and pins that keep them."""

import enum

import msgspec

from silo.rpc.declaring import Ask, Done, Reply, SlowAsk


class SampledEntry(msgspec.Struct, frozen=True, array_like=True):
    """One scalar: `offset` bytes from the begin of its row; `swapped`: big-endian there."""

    suffix: str
    dtype: str
    offset: int
    swapped: bool = False


class SampledName(msgspec.Struct, frozen=True):
    """Where the samples of a name stand: in rows of the group `group`, one at every `divider` ticks.

    A name may have two groups: its own buffer, and what came after that was full. `shape` is that of the element, empty
    for a single entry. `is_complex`: the entries are real and imaginary parts in turns.
    """

    name: str
    group: int
    divider: int
    shape: tuple[int, ...]
    entries: list[SampledEntry]
    is_complex: bool = False


class SampledRows(msgspec.Struct, frozen=True):
    """Rows `first ... first + count - 1` since start, without a gap.

    Each row opens with its tick and its time stamp in ns, both int64; the words of its entries follow, as they stand in
    a ring: its memory is copied once, however many elements are asked for. All little-endian.
    """

    group: int
    first: int
    count: int
    data: bytes


class StreamFrame(msgspec.Struct, frozen=True):
    """What came since the last frame of a stream: put on `.../stream/<id>`; `generation` is that of `StreamOpened`.

    A row number beyond the one that was expected is a loss; a smaller one with another `run` is a new start. `earlier`
    are the rows of the runs before it, of all groups, that were to come since the stream was opened: where fewer did,
    the others were lost at the end of a run; -1 where that isn't told.
    """

    generation: int
    run: str
    rows: list[SampledRows]
    earlier: int = -1


class Columns(Reply, frozen=True, omit_defaults=True):
    """Minimum and maximum per column: little-endian float64 of shape `(len(names), count)`, NaN without finite value.

    They are offsets from `bases` (by place in `names`, 0 where it isn't named), so that integers beyond 2^53 are exact.
    `marks` are bytes of the same shape, empty for all 0: see `silo.core.arrays.columns.Mark`, and `Hole` in the upper
    four bits. `until_ns` is the newest time stamp that is surely in it.
    """

    names: list[str]
    first: int
    count: int
    column_ns: int
    low: bytes
    high: bytes
    marks: bytes = b""
    bases: dict[int, int] = {}
    until_ns: int = 0


class SampleRows(Reply, frozen=True, omit_defaults=True):
    """Raw rows of some names, of which `rows` has at most one stretch per group.

    `resume` has for each group the row to go on with and the row to end before; both are equal where nothing is left.
    Ask again with it and with `run` until then. `names` explains the rows, and comes with the first reply only.
    `missing` says of names without rows why, by name.
    """

    run: str
    rows: list[SampledRows]
    resume: list[tuple[int, int]]
    names: list[SampledName] = []
    missing: dict[str, str] = {}


class StreamLayout(msgspec.Struct, frozen=True):
    """How to read the frames of a stream that are of this `generation`: their groups are as in `names`."""

    generation: int
    names: list[SampledName]


class StreamOpened(Reply, frozen=True):
    """How to read the frames of a stream: those of this `generation` have groups as in `names`.

    `run` is the present one, `-` before the first: a client of which nothing has come asks to go on behind it.
    `earlier` tells the same of generations that came and went since the one that the client knows: their frames are on
    their way to it. `missed` are rows of runs that came and went behind the one that the client knew while it had no
    stream here, told once.
    """

    stream: str
    generation: int
    names: list[SampledName]
    missing: dict[str, str]
    run: str = ""
    earlier: list[StreamLayout] = []
    missed: int = 0


class PinOpened(Reply, frozen=True):
    """What a pin holds: rows of the `run` with time stamps from `begin_ns` to `end_ns`, both included, 0 where none.

    `text` says what of the wish could not be had, and why; empty where all of it is held. `oldest_ns` is the oldest
    time stamp that the buffers held of any of these names, 0 where they held none.
    """

    pin: str
    run: str
    begin_ns: int
    end_ns: int
    size_bytes: int
    missing: dict[str, str] = {}
    text: str = ""
    oldest_ns: int = 0


class By(str, enum.Enum):
    """What the ends of a stretch of samples count."""

    TIME = "time"  # ns
    TICK = "tick"  # since start
    ROW = "row"  # samples since start, of each element its own


class GetHistory(SlowAsk[Columns], frozen=True):
    """Past samples in columns of `column_ns`. Column k covers `[k, k + 1) * column_ns`.

    `names` are entry names (`/log/q_x`). At most 4096 columns.
    """

    names: list[str]
    start_ns: int
    end_ns: int
    column_ns: int
    pin: str = ""  # of what this pin holds


class GetSamples(SlowAsk[SampleRows], frozen=True):
    """Raw samples of elements or entries, with `start <= time stamp, tick or row < end`; of what a pin holds, if named.

    The reply has at most `reply_bytes` of rows and says how to go on: ask again with its `run` and `resume`.
    """

    names: list[str]
    start: int = -(2**62)
    end: int = 2**62
    by: By = By.TIME
    reply_bytes: int = 2**20
    pin: str = ""
    run: str = ""
    resume: list[tuple[int, int]] = []


class OpenStream(Ask[StreamOpened], frozen=True):
    """Open or renew the stream `stream` (an id as of a view): all samples of these names from now on, as they come.

    Frames come each `period_s` on `.../stream/<id>`. Leased as a view is. Frames that the client does not take in time
    are dropped: its rows are numbered, so that it sees the gap. A name that the table lost meanwhile is left out and
    told (`again`: this client had the stream open before, maybe with another helper process). `proof` as of a view.
    `run` is that of which rows came last, `rows` the next one of each group of a name (-1: none came): it goes on
    there, or with the first row of the run that is the present one by now, as far back as a few seconds carry.
    `known` is the newest generation that the client can read, -1 for none.
    """

    stream: str
    names: list[str]
    period_s: float = 0.05
    again: bool = False
    proof: str = ""
    run: str = ""
    rows: dict[str, list[int]] = {}
    known: int = -1


class CloseStream(Ask[Done], frozen=True):
    """Send no more frames of this stream."""

    stream: str
    proof: str = ""


class OpenPin(SlowAsk[PinOpened], frozen=True):
    """Copy what the buffers hold of these names from `start_ns` to `end_ns`, both included, for later requests.

    `pin` is an id as of a view, and `proof` too. The newest part is copied where not all fits. It ends when it isn't
    kept for 30 s.
    """

    pin: str
    names: list[str]
    start_ns: int
    end_ns: int
    proof: str = ""


class KeepPin(Ask[Done], frozen=True):
    """I still need this pin; refused (why: NOT_FOUND) where it is no more."""

    pin: str
    proof: str = ""


class ClosePin(Ask[Done], frozen=True):
    """Forget this pin."""

    pin: str
    proof: str = ""
