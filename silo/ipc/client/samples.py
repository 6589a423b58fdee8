"""Past samples: as rows, as columns, in numbers; and pins that keep them."""

import secrets
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from silo.arguments import texts
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import By, GetHistory, GetSamples, GetSurvey, KeepPin, OpenPin, Survey, by_of

if TYPE_CHECKING:
    from silo.columns import HistoryColumns
    from silo.ipc.samples import Pin, Samples


@told_class("client")
class SampleCalls(Calls):
    """Samples that the buffers hold."""

    def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, pin: "Pin | None" = None
    ) -> "HistoryColumns":
        """Return past samples as minimum and maximum per column, straight from the buffers or of a pin.

        Args:
            names: 1 to 64 entries.
            start_ns: the first time stamp.
            end_ns: the time stamp after the last.
            column_ns: width of a column; there may be at most 4096.
            pin: what to read instead of the buffers.

        Returns:
            Columns of all names, of which column k covers the time stamps from `k * column_ns` to before the next.

        Raises:
            RefusedError: a name is unknown, a number out of range, or the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.view import history_columns

        request = GetHistory(
            names=texts("names", names, "['/log/joints/q_0']"),
            start_ns=start_ns,
            end_ns=end_ns,
            column_ns=column_ns,
            pin=pin.id if pin is not None else "",
            client=self._name,
        )
        return history_columns(self._call(request))

    def samples(
        self,
        names: Sequence[str],
        start: int = -(2**62),
        end: int = 2**62,
        by: By | str = By.TIME,
        pin: "Pin | None" = None,
        reply_bytes: int = 2**20,
        told: Callable[[float], None] | None = None,
    ) -> "dict[str, Samples]":
        """Return all samples that the buffers (or a pin) hold of elements or entries, with `start <= ... < end`.

        What comes while it is read is left out.

        Args:
            names: elements or entries, 1 to 10 000.
            start: the first, see `by`.
            end: the one after the last, see `by`.
            by: `"time"`: the ends are time stamps in ns; `"tick"`: ticks since start; `"row"`: numbers of samples since
                start.
            pin: what to read instead of the buffers.
            reply_bytes: size of the pieces in which they are asked for, 4096 to 4 MiB.
            told: called with the share that has come, 0 to 1.

        Returns:
            By name: `ticks` and `time_ns` of shape `(n,)`, `values` of shape `(n, *shape of the element)`, oldest
            first; of a name without samples `why` there are none.

        Raises:
            RefusedError: the logger was started anew meanwhile, a name or `by` is unknown, a number out of range, or
                the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Gathering

        request = GetSamples(
            names=texts("names", names, "['/log/joints/q']"),
            start=start,
            end=end,
            by=by_of(by),
            reply_bytes=reply_bytes,
            pin=pin.id if pin is not None else "",
            client=self._name,
        )
        gathering = Gathering(request.names)
        while True:
            reply = self._call(request)
            gathering.take(reply)
            if told is not None:
                told(gathering.share)
            if all(row >= stop for row, stop in reply.resume):
                return gathering.samples()
            request = GetSamples(
                names=request.names, by=request.by, reply_bytes=reply_bytes, pin=request.pin, run=reply.run,
                resume=reply.resume, client=self._name,
            )  # fmt: skip

    def survey(
        self,
        quantities: Sequence[str],
        names: Sequence[str] = (),
        *,
        reset: bool = False,
        derived: bool = False,
        some: Sequence[str] = (),
        some_quantities: Sequence[str] = (),
    ) -> Survey:
        """Return quantities of elements or entries, with statistics over all samples since this client asked first.

        The statistics end when it hasn't asked for a minute.

        Args:
            quantities: one or several of `silo.ipc.surveys.QUANTITIES`, such as `"mean"`, `"std"`, `"rate"` (Hz).
            names: elements or entries, at most 20 000; all elements of the table where it is empty.
            reset: begin the statistics anew.
            derived: without names, the table's derived signals follow its elements.
            some: elements or entries of which more is wanted, of the same samples as the others.
            some_quantities: what is wanted of these.

        Returns:
            The survey; its `values` are the bytes of float64 of shape `(quantities, names)`, NaN where a quantity isn't
            known; `some` those of `(some_quantities, some)`.

        Raises:
            RefusedError: a quantity is unknown, there are too many names, or too many clients have statistics.
            ElementError: one of both is no list of texts; nothing was asked.
        """
        request = GetSurvey(
            quantities=texts("quantities", quantities, "['mean', 'std']"),
            names=texts("names", names, "['/log/joints/q']"),
            reset=reset,
            derived=derived,
            some=texts("some", some, "['/log/joints/q']"),
            some_quantities=texts("some_quantities", some_quantities, "['mean', 'std']"),
            client=self._name,
        )
        return self._call(request)

    def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> "Pin":
        """Have the helper process keep a copy of what the buffers hold, whatever they overwrite.

        `samples` and `history` read it until it is closed. Where not all fits the newest part is kept: 64 MiB for all
        clients together.

        Args:
            names: elements or entries, 1 to 10 000.
            start_ns: the first time stamp.
            end_ns: the last time stamp.

        Returns:
            The pin; its `opened` says what is held: time stamps in ns, `size_bytes`, and of names without rows why.

        Raises:
            RefusedError: nothing of it fits, a name is unknown, a number out of range, or too many pins are open.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Pin

        request = OpenPin(
            pin=f"{secrets.token_hex(8)}-1",  # of its own, because it outlives the session
            names=texts("names", names, "['/log/joints/q']"),
            start_ns=start_ns,
            end_ns=end_ns,
            client=self._name,
        )
        opened = self._call(request)
        pin = Pin(request.names, opened, KeepPin(pin=opened.pin, client=self._name), self._leases.forget)
        self._connection.attach(pin)
        self._leases.add(pin)
        return pin
