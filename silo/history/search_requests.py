"""Moments that one looks for in all that is held of some signals."""

import math

import msgspec

from silo.core.elements import Sought
from silo.rpc.declaring import Reply, SlowAsk


class FoundIn(msgspec.Struct, frozen=True, omit_defaults=True):
    """What was found of one name, oldest first: `total` moments, of which `before` come before those that are here.

    `time_ns` are little-endian int64, `values` beside them of the type `dtype`: those of the samples, of a hole its
    length in ns. All from `begin_ns` to `end_ns` was looked through, both 0 where nothing is held; `why` says why.
    """

    name: str
    total: int = 0
    before: int = 0
    time_ns: bytes = b""
    values: bytes = b""
    dtype: str = "<f8"
    begin_ns: int = 0
    end_ns: int = 0
    why: str = ""


class MomentsFound(Reply, frozen=True):
    """What was found, in the order of the names that were asked for."""

    run: str
    found: list[FoundIn]


class FindMoments(SlowAsk[MomentsFound], frozen=True):
    """Look for something in all samples of 1 to 64 entries that buffers and `pins` hold of `run` (empty: the newest).

    From `start_ns` to `end_ns`, both included. The reply has of each name the `most` moments next to `around_ns`, and
    how many there are in all. `level` and `direction` (1 rising, -1 falling, 0 either) are of a crossing, with peaks
    -1 is of troughs, of what is outside of the last samples that are; `bounds` of each name are what is inside. A hole
    is longer than `level` seconds.
    """

    names: list[str]
    what: Sought
    level: float = 0.0
    direction: int = 0
    bounds: list[tuple[float | None, float | None]] = []
    start_ns: int = -(2**62)
    end_ns: int = 2**62
    around_ns: int = 0
    most: int = 100
    pins: list[str] = []
    run: str = ""


class SpanFacts(msgspec.Struct, frozen=True, omit_defaults=True):
    """Facts of one name from A to B, as `silo.expressions.span` has them; `why` says why there are none."""

    name: str
    at_a: float = math.nan
    at_b: float = math.nan
    mean: float = math.nan
    std: float = math.nan
    rms: float = math.nan
    smallest: float = math.nan
    largest: float = math.nan
    samples: int = 0
    not_finite: int = 0
    why: str = ""


class SpanMeasured(Reply, frozen=True):
    """What was measured, in the order of the names that were asked for."""

    run: str
    found: list[SpanFacts]


class MeasureSpan(SlowAsk[SpanMeasured], frozen=True):
    """Measure 1 to 64 entries from time stamp `a_ns` to `b_ns`, both included, whichever is earlier.

    In all samples that buffers and `pins` hold of `run` (empty: the newest).
    """

    names: list[str]
    a_ns: int
    b_ns: int
    pins: list[str] = []
    run: str = ""
