"""What a client shows as it happens: views, and surveys of quantities."""

from silo.rpc.declaring import Ask, Done, Reply, SlowAsk


class ViewOpened(Reply, frozen=True):
    """How to read the frames of a view.

    `entries` are the entries of `values`, element after element; `unpublished` the elements without live values, as
    they are disabled (frames say of the others why they aren't live); `missing` the names that the table doesn't have.
    """

    view: str
    generation: int
    entries: list[str]
    plots: list[str]
    unpublished: list[str]
    missing: list[str]


class Survey(Reply, frozen=True):
    """`values`: float64 of shape `(quantities, names)`, NaN where a quantity isn't known.

    Without names they are those of the table of `revision`, in its order. Statistics begin at `since_ns`; `skipped`
    rows were overwritten before they could be read, because their buffer is very small. `jitter_s` is that of the loop:
    the standard deviation of the time between its ticks, 0 where it isn't known. `some` are the values that were asked
    for of some elements and entries, as `values`, of the same samples; empty from helpers before 0.3.
    """

    revision: int
    time_ns: int
    since_ns: int
    values: bytes
    skipped: int = 0
    jitter_s: float = 0.0
    some: bytes = b""


class OpenView(Ask[ViewOpened], frozen=True):
    """Open or replace the view `view` (an id that the client makes): one `ViewFrame` per refresh.

    `values` are element names of which the newest value of every entry is wanted, `plots` entry names of which minimum
    and maximum per column of `column_ns` are wanted. A view ends when it isn't opened again within its lease (6 s; the
    same request renews it) or when its client's liveliness token disappears. `proof` shows that the id is this
    client's (see the keys): others are refused.
    """

    view: str
    values: list[str] = []
    plots: list[str] = []
    rate_hz: float = 5.0
    column_ns: int = 100_000_000
    proof: str = ""


class CloseView(Ask[Done], frozen=True):
    """Send no more frames of this view."""

    view: str
    proof: str = ""


class GetSurvey(SlowAsk[Survey], frozen=True):
    """Quantities (`silo.live.quantities`) of some elements or entries, of all elements of the table without `names`.

    These are followed by its derived signals with `derived`. `some_quantities` of the elements and entries `some` come
    beside them, of the same samples: what stands in one row of a table is of one moment.

    Statistics are over every sample since this client asked first, or since its last `reset`; they end when it hasn't
    asked for a minute. `id` tells them from those of others, and `proof` shows that it is this client's; an older
    client says neither: its are those of its name.
    """

    quantities: list[str]
    names: list[str] = []
    reset: bool = False
    derived: bool = False
    some: list[str] = []
    some_quantities: list[str] = []
    id: str = ""
    proof: str = ""
