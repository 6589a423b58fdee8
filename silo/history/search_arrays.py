"""What clients look for in all that is held, and what was found, as arrays: on their side of `search_requests`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from silo.core.arguments import texts
from silo.core.calls import told_class
from silo.core.elements import Sought
from silo.errors import ConnectionLostError
from silo.history.search_requests import FindMoments, FoundIn, MeasureSpan, MomentsFound, SpanFacts
from silo.rpc.declaring import Caller
from silo.rpc.foreign import NOT_UNDERSTOOD
from silo.rpc.refusals import meant

if TYPE_CHECKING:
    from silo.expressions.search import FoundMoments
    from silo.expressions.span import Between
    from silo.history.arrays import Pin


@told_class("client")
class SearchRequests(Caller):
    """Moments and facts of what is held."""

    def find(
        self,
        names: Sequence[str],
        what: Sought | str,
        level: float = 0.0,
        direction: int = 0,
        bounds: Sequence[tuple[float | None, float | None]] = (),
        start_ns: int = -(2**62),
        end_ns: int = 2**62,
        around_ns: int = 0,
        most: int = 100,
        pins: "Sequence[Pin]" = (),
        run: str = "",
    ) -> "dict[str, FoundMoments]":
        """Look for something in every sample that buffers and pins hold; the helper process looks, nothing is fetched.

        Args:
            names: 1 to 64 entries.
            what: `"highest"`, `"lowest"`, `"crossing"`, `"edge"`, `"peak"`, `"change"`, `"not finite"`, `"outside"`,
                `"hole"`. A peak is where a signal is highest between a rise and a fall by most of what it spans.
            level: what is crossed.
            direction: 1 for a rising crossing, -1 for a falling one, 0 for either; -1 with peaks for troughs.
            bounds: of each name the smallest and the largest value that isn't outside, None for none.
            start_ns: the first time stamp.
            end_ns: the last time stamp.
            around_ns: the moments next to this one are in the answer.
            most: how many of each name; all names together have at most 10 000.
            pins: what is looked through beside the buffers, where it has what these have no more.
            run: the run that it is about, as pins name it; the newest where it is empty.

        Returns:
            By name: `total` moments, of which `before` come before those that are here as `time_ns` and `values`, both
            of shape `(n,)`; `begin_ns` and `end_ns` say what was looked through, `why` why nothing was.

        Raises:
            RefusedError: a name or `what` is unknown, a number out of range, or a pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        sought = meant(Sought, "what", what, "nothing was asked")
        request = FindMoments(
            names=texts("names", names, "['/log/joints/q_0']"), what=sought, level=level, direction=direction,
            bounds=list(bounds), start_ns=start_ns, end_ns=end_ns, around_ns=around_ns, most=most,
            pins=[pin.id for pin in pins], run=run,
        )  # fmt: skip
        return found_of(self._call(request))

    def _measure(
        self, names: Sequence[str], a_ns: int, b_ns: int, pins: "Sequence[Pin]" = (), run: str = ""
    ) -> "dict[str, Between]":
        """Measure signals between two moments in every sample that is held; the helper process adds up.

        By name: what held at A and at B, difference and slope per second, mean, standard deviation, root mean square,
        smallest and largest of the finite samples from the one that held at the earlier moment on, and how many there
        are. `pins` and `run` are those of `find`.
        """
        request = MeasureSpan(
            names=texts("names", names, "['/log/joints/q_0']"), a_ns=a_ns, b_ns=b_ns, pins=[pin.id for pin in pins],
            run=run,
        )  # fmt: skip
        return {one.name: _between(one, (b_ns - a_ns) / 1e9) for one in self._call(request).found}


def found_of(reply: MomentsFound) -> "dict[str, FoundMoments]":
    """Return what was found by name. Raises ConnectionLostError for a reply that makes no sense."""
    return {one.name: _found(one) for one in reply.found}


def _found(one: FoundIn) -> "FoundMoments":
    import numpy as np

    from silo.expressions.search import FoundMoments

    try:
        time_ns = np.frombuffer(one.time_ns, "<i8").astype(np.int64)
        values = np.frombuffer(one.values, one.dtype) if one.values else np.zeros(len(time_ns), one.dtype)
    except NOT_UNDERSTOOD as error:
        raise ConnectionLostError(f"the helper process tells of moments that make no sense: {error}") from error
    if len(values) != len(time_ns) or not 0 <= one.before <= one.total - len(time_ns):
        raise ConnectionLostError(f"the helper process tells of moments of {one.name} that make no sense")
    return FoundMoments(one.total, one.before, time_ns, values, one.begin_ns, one.end_ns, one.why)


def _between(one: SpanFacts, seconds: float) -> "Between":
    from silo.core.structs import alike
    from silo.expressions.span import NAN, Between

    difference = one.at_b - one.at_a
    return alike(Between, one, difference=difference, slope=difference / seconds if seconds else NAN)
