"""The thread between the screen and a logger: it makes the blocking calls, the event loop only awaits them.

`Link` keeps the latest request for a view and hands out the latest frame, never a queue of either: a slow terminal sees
fewer frames, not old ones. What the client reports by itself reaches the app as frozen messages.
"""

import asyncio
import functools
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np
from textual.message import Message

from silo.core.arrays.columns import ColumnStore, HistoryColumns
from silo.errors import ConnectionLostError, RefusedError
from silo.rpc.frames import Frame
from silo.rpc.published import Event
from silo_tui.model.samples.source import Samples, entry_samples

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.history.arrays import Pin
    from silo.live.view import View

Result = TypeVar("Result")

MOST_NAMES = 64  # of which a logger answers with columns at once


async def refusal(sent: Awaitable[object]) -> str:
    """Return why something was refused; empty where it was done."""
    try:
        await sent
    except RefusedError as error:
        return str(error)
    return ""


class ViewRequest(msgspec.Struct, frozen=True):
    """What a screen wants to see: one view per screen."""

    values: tuple[str, ...] = ()
    plots: tuple[str, ...] = ()
    column_ns: int = 100_000_000


@dataclass
class LinkChanged(Message):
    """The helper process answers again, or no longer."""

    link: "Link"
    connected: bool


@dataclass
class LoggerEvent(Message):
    """Something happened in the logger."""

    link: "Link"
    event: Event


@dataclass
class ViewFailed(Message):
    """The logger would not open the view that a screen requested."""

    link: "Link"
    error: Exception


class Link:
    """One logger's connection as the event loop uses it. Make it in the event loop, close it when done."""

    def __init__(self, client: "Client", post: Callable[[Message], Any], rate_hz: float) -> None:
        self._client = client
        self._post = post
        self._rate_hz = rate_hz
        # two threads: a save or an apply that takes long must not hold up the view of a screen that scrolls
        self._control = ThreadPoolExecutor(1, "silo-tui control")
        self._reading = ThreadPoolExecutor(1, "silo-tui reading")
        self._lock = threading.Lock()
        self._request = ViewRequest()
        self._opened: ViewRequest | None = None
        self._view: View | None = None
        self._opening = False
        self._closed = False
        client.on_event(lambda event: self._tell(LoggerEvent(self, event)))
        client.on_link(lambda connected: self._tell(LinkChanged(self, connected)))

    @property
    def connected(self) -> bool:
        """Whether the helper process answers."""
        return self._client.connected

    @property
    def logger_key(self) -> str:
        """What tells the logger from all others, the one that it follows now."""
        return self._client.found.key

    @property
    def identity(self) -> str:
        """By which the logger tells us from other operators."""
        return self._client._identity

    async def call(self, job: "Callable[[Client], Result]") -> Result:
        """Run a call that may change something, one after the other."""
        return await self._run(self._control, job)

    async def read(self, job: "Callable[[Client], Result]") -> Result:
        """Run a call that only reads, beside those that change something."""
        return await self._run(self._reading, job)

    async def aside(self, job: "Callable[[Client], Result]") -> Result:
        """Run a call that may take minutes in a thread of its own: nothing waits for it."""
        if self._closed:
            raise ConnectionLostError("the connection was closed")
        return await asyncio.to_thread(job, self._client)

    async def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, *pin: "Pin"
    ) -> HistoryColumns:
        """Return columns of any number of entries, or of what is pinned, asked for in pieces that are answered."""

        def ask(some: Sequence[str], client: "Client") -> HistoryColumns:
            return client.history(some, start_ns, end_ns, column_ns, *pin)

        if not names:
            return HistoryColumns((), 0, column_ns, np.zeros((0, 0)), np.zeros((0, 0)))
        store, until = ColumnStore((), 1, column_ns), None
        for begin in range(0, len(names), MOST_NAMES):
            past = await self.read(functools.partial(ask, names[begin : begin + MOST_NAMES]))
            if not begin:
                store, until = ColumnStore(names, max(1, past.low.shape[1]), column_ns), past.until_ns
            store.take(past)
        return store.stretch(until)

    async def samples(
        self, names: Sequence[str], start_ns: int, end_ns: int, pin: "Pin | None" = None, reply_bytes: int = 2**20
    ) -> dict[str, Samples]:
        """Return samples of entries from one time to before another, of the buffers or of what is pinned."""
        found = await self.read(lambda client: client.samples(names, start_ns, end_ns, "time", pin, reply_bytes))
        return {name: entry_samples(some.time_ns, some.values) for name, some in found.items()}

    def watch(self, request: ViewRequest) -> None:
        """Make frames be about this from now on; several calls in a row cost one request."""
        with self._lock:
            self._request = request
            if self._opening or self._closed or request == self._opened:
                return
            self._opening = True
        self._reading.submit(self._open_requested)

    def watch_again(self) -> None:
        """Open the view anew, after the link came back or the logger was changed."""
        with self._lock:
            self._opened = None
            request = self._request
        self.watch(request)

    def set_rate(self, rate_hz: float) -> None:
        """Ask for frames this often from now on."""
        self._rate_hz = rate_hz
        self.watch_again()

    def frame(self) -> Frame | None:
        """Return the newest frame of what was requested last; None when nothing new came."""
        view = self._view
        return view.frame() if view is not None else None

    def try_now(self) -> None:
        """Look for the helper process at once."""
        self._client._try_now()

    def close(self) -> None:
        """Close the connection without waiting for calls that are under way."""
        with self._lock:
            self._closed = True
        self._control.shutdown(wait=False, cancel_futures=True)
        self._reading.shutdown(wait=False, cancel_futures=True)
        view, self._view = self._view, None
        if view is not None and self._client.connected:
            view.close()
        self._client.close()

    async def _run(self, threads: ThreadPoolExecutor, job: "Callable[[Client], Result]") -> Result:
        if self._closed:
            raise ConnectionLostError("the connection was closed")
        return await asyncio.get_running_loop().run_in_executor(threads, functools.partial(job, self._client))

    def _open_requested(self) -> None:
        while True:
            with self._lock:
                request = self._request
                if self._closed or request == self._opened:
                    self._opening = False
                    return
            try:
                self._replace_view(request)
            except Exception as error:  # noqa: BLE001 - told to the screen, which shows it
                with self._lock:
                    self._opening = False
                self._tell(ViewFailed(self, error))
                return
            with self._lock:
                self._opened = request

    def _replace_view(self, request: ViewRequest) -> None:
        old = self._view
        view = None
        if request.values or request.plots:
            view = self._client.view(request.values, request.plots, self._rate_hz, request.column_ns)
        self._view = view
        if old is not None:
            old.close()

    def _tell(self, message: Message) -> None:
        if not self._closed:
            self._post(message)
