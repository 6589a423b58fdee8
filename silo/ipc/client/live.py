"""What comes from now on: views, topics, streams."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from silo.arguments import text, texts
from silo.calls import told_class
from silo.errors import ConnectionLostError, RefusedError
from silo.ipc.client.state import StateCalls
from silo.ipc.messages import OpenStream, OpenView
from silo.ipc.words import full_name, why_silent
from silo.scripts.requests import TableRequests

if TYPE_CHECKING:
    from silo.ipc.samples import Stream
    from silo.ipc.topic import Topic
    from silo.ipc.view import View


@told_class("client")
class LiveCalls(StateCalls, TableRequests):
    """What comes from now on."""

    def view(
        self,
        values: Sequence[str] = (),
        plots: Sequence[str] = (),
        rate_hz: float = 5.0,
        column_ns: int = 100_000_000,
    ) -> "View":
        """Open a view: newest values and fill of elements, minimum and maximum per column of entries.

        It goes on across reconnections until it is closed.

        Args:
            values: the elements.
            plots: the entries.
            rate_hz: frames per second.
            column_ns: width of a column.

        Returns:
            The view; its `read()` gives frames.

        Raises:
            RefusedError: a name or number is out of range.
            ConnectionLostError: nobody answers.
        """
        from silo.ipc.view import View

        request = OpenView(
            view="",
            values=texts("values", values, "['/log/joints/q']"),
            plots=texts("plots", plots, "['/log/joints/q_0']"),
            rate_hz=rate_hz,
            column_ns=column_ns,
            client=self._name,
        )
        view = View(request, next(self._leases.numbers), lambda: self._leases.renew_soon(view), self._leases.forget)
        self._connection.attach(view)
        try:
            view.accept(self._call(view.request))
        except (RefusedError, ConnectionLostError):
            view.close()
            raise
        self._leases.add(view)
        return view

    def topic(self, element: str) -> "Topic":
        """Subscribe to every sample of a published element: `for batch in client.topic("joints/q"): ...`.

        Args:
            element: its full name, or the name after the prefix.

        Returns:
            The subscription; close it, or use it as a context manager.

        Raises:
            ElementError: there is no such element.
        """
        return self._topic(element, self._connection.forget)

    def _topic(self, element: str, on_close: Callable[["Topic"], None]) -> "Topic":
        from silo.ipc.topic import Topic

        text("element", element, "client.topic('/log/joints/q')")
        name = full_name(element, self.status(), self.table())
        topic = Topic(name, on_close, lambda: why_silent(name, self.status(), self.table()))
        self._connection.attach(topic)
        return topic

    def stream(self, names: Sequence[str], period_s: float = 0.05) -> "Stream":
        """Subscribe to every sample of elements or entries from now on, whatever their action; iterate over it.

        It goes on across reconnections and new starts until it is closed. Numbered: what this reader is too slow for is
        counted, and never holds up the helper process.

        Args:
            names: elements or entries, at least one.
            period_s: time between two deliveries, s.

        Returns:
            The stream, of batches with `Samples` by name; close it, or use it as a context manager.

        Raises:
            RefusedError: a name is unknown, a number out of range, or too many streams are open.
            ConnectionLostError: nobody answers.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.ipc.samples import Stream

        wished = texts("names", names, "['/log/joints/q']")
        request = OpenStream(stream="", names=wished, period_s=period_s, client=self._name)
        stream = Stream(
            request, next(self._leases.numbers), lambda: self._leases.renew_soon(stream), self._leases.forget
        )
        self._connection.attach(stream)
        try:
            stream.accept(self._call(stream.request))
        except (RefusedError, ConnectionLostError):
            stream.close()
            raise
        self._leases.add(stream)
        return stream
