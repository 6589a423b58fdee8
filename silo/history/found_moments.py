"""Moments that a helper process found, as arrays."""

import numpy as np

from silo.errors import ConnectionLostError
from silo.expressions.search import FoundMoments
from silo.expressions.span import NAN, Between
from silo.history.search_requests import FoundIn, MomentsFound, SpanFacts, SpanMeasured
from silo.rpc.foreign import NOT_UNDERSTOOD


def found_of(reply: MomentsFound) -> dict[str, FoundMoments]:
    """Return what was found by name. Raises ConnectionLostError for a reply that makes no sense."""
    return {one.name: _found(one) for one in reply.found}


def _found(one: FoundIn) -> FoundMoments:
    try:
        time_ns = np.frombuffer(one.time_ns, "<i8").astype(np.int64)
        values = np.frombuffer(one.values, one.dtype) if one.values else np.zeros(len(time_ns), one.dtype)
    except NOT_UNDERSTOOD as error:
        raise ConnectionLostError(f"the helper process tells of moments that make no sense: {error}") from error
    if len(values) != len(time_ns) or not 0 <= one.before <= one.total - len(time_ns):
        raise ConnectionLostError(f"the helper process tells of moments of {one.name} that make no sense")
    return FoundMoments(one.total, one.before, time_ns, values, one.begin_ns, one.end_ns, one.why)


def between_of(reply: SpanMeasured, a_ns: int, b_ns: int) -> dict[str, Between]:
    """Return what was measured by name."""
    return {one.name: _between(one, (b_ns - a_ns) / 1e9) for one in reply.found}


def _between(one: SpanFacts, seconds: float) -> Between:
    difference = one.at_b - one.at_a
    return Between(
        one.at_a, one.at_b, difference, difference / seconds if seconds else NAN, one.mean, one.std, one.rms,
        one.smallest, one.largest, one.samples, one.not_finite,
    )  # fmt: skip
