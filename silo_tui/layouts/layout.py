"""What a view keeps. A new field touches `KeptLayout`, `FIELDS` of `texts` and both functions of `views`."""

from collections.abc import Mapping

import msgspec


class KeptLayout(msgspec.Struct, frozen=True):
    """Names are without the logger's prefix, so that a view of one robot fits the next; no plots: the table alone."""

    sort: str = "name"
    turned: bool = False  # the order the other way round
    filter: str = ""
    columns: tuple[str, ...] = ()
    set: str = "settings"  # of live columns, as C steps through them
    folded: tuple[str, ...] = ()  # name spaces
    unfolded: tuple[str, ...] = ()  # vectors that show their entries
    components: Mapping[str, str] = msgspec.field(default_factory=dict)  # of vectors: the suffix of an entry, or norm
    inspector: bool | None = None  # whether somebody opened or closed it; None: by the width of the screen
    plots: tuple[tuple[str, ...], ...] = ()  # signals that share a plot
    chosen: str = ""
    span_s: float = 10.0
    scales: Mapping[str, tuple[float, float]] = msgspec.field(default_factory=dict)  # held, by plot: its signals with |
    logs: tuple[str, ...] = ()  # signals whose axis has powers of ten
    most: int = 0  # only so many rows, the first of the order as it was measured then; 0: all
