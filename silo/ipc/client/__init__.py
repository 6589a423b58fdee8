"""A client of one logger: what `silo`, `silo-tui` and your own programs use to talk to a helper process.

All calls block until the answer is there, and may be made by any thread. A refusal raises RefusedError (with `why` and
`problems`), silence ConnectionLostError; the connection comes back by itself. No NumPy is imported before a view, a
topic or a history is asked for.

The calls stand in a module per topic, `Client` is made of them.
"""

import contextlib
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from silo.arguments import real, shown, switch, text
from silo.calls import told, told_class
from silo.conditions.requests import ConditionRequests
from silo.display import html_table
from silo.errors import ElementError, SiloError
from silo.ipc.addresses import parse_url
from silo.ipc.client.calling import LONGEST_S
from silo.ipc.client.control import ControlCalls
from silo.ipc.client.events import EventCalls
from silo.ipc.client.files import FileCalls
from silo.ipc.client.leases import Leases
from silo.ipc.client.live import LiveCalls
from silo.ipc.client.moments import MomentCalls
from silo.ipc.client.recorders import RecorderCalls
from silo.ipc.client.samples import SampleCalls
from silo.ipc.client.saves import Saves
from silo.ipc.connection import Connection
from silo.ipc.discovery import Discovery, discover
from silo.ipc.exchange import client_name
from silo.ipc.found import Found
from silo.ipc.messages import Ask
from silo.ipc.published import Event

if TYPE_CHECKING:
    from silo.ipc.topic import Topic

__all__ = ["Client", "Discovery", "Found", "connect", "discover", "topic"]


@told_class("client", make="Client")
class Client(
    LiveCalls,
    SampleCalls,
    MomentCalls,
    EventCalls,
    FileCalls,
    RecorderCalls,
    ControlCalls,
    ConditionRequests,
):
    """A connection to one logger. A context manager."""

    def __init__(self, found: Found, timeout_s: float = Ask.timeout_s, *, read_only: bool = False) -> None:
        """Connect to a logger that was found; `connect` looks for it.

        Args:
            found: which logger.
            timeout_s: how long to wait for an answer, at least.
            read_only: send nothing that changes something.

        Raises:
            ConnectionLostError: nobody answers.
            ElementError: that is no logger that was found.
        """
        if not isinstance(found, Found):
            raise ElementError(f"a client is made by silo.connect('robot'), got {shown(found)}")
        self._timeout_s = timeout_s
        self.read_only = read_only
        self._name = client_name()
        self._saves = Saves()
        self._connection = Connection(found, timeout_s, self._name, self._renew)
        self._leases = Leases(self._connection, self._name)
        self._connection.on_event(self._saves.note)
        self._connection.on_link(self._saves.note_link)
        self._connection.watch()

    @classmethod
    def connect(
        cls,
        logger: "str | Found" = "",
        timeout_s: float = Ask.timeout_s,
        config: str = "",
        *,
        read_only: bool = False,
    ) -> "Client":
        """Connect to a logger.

        Args:
            logger: what `discover` found, an address (`robot3/anymal`; a bare name, where only one has it, `name.pid`
                of several on this computer, `host~id/name` of several hosts of one name), or empty for the only one.
            timeout_s: how long to wait for an answer, at least.
            config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.
            read_only: send nothing that changes something, whatever the role; calls that would raise RefusedError.

        Returns:
            A client; close it, or use it as a context manager.

        Raises:
            ConnectionLostError: there is none, or several could be meant; the message says what to do.
        """
        switch("read_only", read_only)
        timeout_s = real("timeout_s", timeout_s, 0, LONGEST_S, "s", include_low=False)
        if isinstance(logger, Found):
            return cls(logger, timeout_s, read_only=read_only)
        text("logger", logger, 'Client.connect("robot")')
        text("config", config, 'Client.connect("robot", config="client.json5")')
        with ExitStack() as holding:
            return cls(discover(timeout_s, config, holding).one(logger), timeout_s, read_only=read_only)

    def act_for(self, caller: str) -> None:
        """Say of changes for whom they are made: as a bridge does, whose own users the robot can't know.

        Args:
            caller: in words; events have them behind the name of who is connected.
        """
        self._name = f"{client_name()} for {caller}"

    def __repr__(self) -> str:
        found = self.found
        where = f" on {found.host}" if found.config else ""
        return f"<Client of {found.label}{where}: {self._state_word}>"

    def _repr_html_(self) -> str:
        found = self.found
        where = found.host if found.config else "this one"
        rows = [("logger", found.label), ("user", found.user), ("host", where), ("state", self._state_word)]
        return html_table(f"Client of {found.label}", ("", ""), rows)

    @property
    def _state_word(self) -> str:
        return "closed" if self._connection.closed else "connected" if self.connected else "not connected"

    @property
    def found(self) -> Found:
        """Which logger this is; changes when the robot program was started anew."""
        return self._connection.found

    @property
    def identity(self) -> str:
        """By which the logger tells this user from other operators: its name over a network; empty without a link."""
        return self._connection.identity

    @property
    def connected(self) -> bool:
        """Whether the helper process answers."""
        return self._connection.connected

    def on_event(self, callback: Callable[[Event], None]) -> None:
        """Call back for every event, in a thread of its own.

        Args:
            callback: must not wait long.
        """
        self._connection.on_event(callback)

    def on_link(self, callback: Callable[[bool], None]) -> None:
        """Call back when the connection is lost or there again.

        Args:
            callback: gets False when the helper process is gone, True when one is there again.
        """
        self._connection.on_link(callback)

    def try_now(self) -> None:
        """Look for the helper process at once, where the link is lost.

        It is looked for by itself five times a second. This returns before it is found: `connected` and `on_link` tell.
        """
        self._connection.try_now()

    def close(self) -> None:
        """End views and connection, and release control; closing twice is fine."""
        if self._held is not None and self.connected:
            with contextlib.suppress(SiloError):  # else its lease ends it
                self.release_control()
        self._connection.close()
        self._saves.wake()

    def _renew(self) -> None:
        self._leases.renew()  # which need the connection first

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@told("silo.connect")
def connect(
    logger: "str | Found" = "", timeout_s: float = Ask.timeout_s, config: str = "", *, read_only: bool = False
) -> Client:
    """Connect to a running logger.

    Args:
        logger: its address (`robot3/anymal`; a bare name, where only one has it, `name.pid` of several on this
            computer, `host~id/name` of several hosts of one name), or empty for the only one.
        timeout_s: how long to wait for an answer, at least.
        config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.
        read_only: send nothing that changes something, whatever the role; calls that would raise RefusedError.

    Returns:
        A client; close it, or use it as a context manager.

    Raises:
        ConnectionLostError: there is none, or several could be meant; the message says what to do.
    """
    return Client.connect(logger, timeout_s, config, read_only=read_only)


@told("silo.topic")
def topic(url: str, timeout_s: float = Ask.timeout_s, config: str = "") -> "Topic":
    """Subscribe to every sample of a published element by its address alone: `for batch in silo.topic(URL)`.

    Args:
        url: `silo://robot3/anymal/log/joints/q`, or `silo:///anymal/log/joints/q` without a host; `silo address` prints
            it.
        timeout_s: how long to wait for an answer, at least.
        config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.

    Returns:
        The subscription, with a connection of its own; close it, or use it as a context manager.

    Raises:
        ConnectionLostError: that is no address, there is no such logger, or several could be meant.
        ElementError: the address names no element, or one that isn't there.
    """
    text("url", url, 'silo.topic("silo://robot3/anymal/log/joints/q")')
    address = parse_url(url)
    if not address.element:
        raise ElementError(f"{url}: names no element: write {url.rstrip('/')}/joints/q; nothing was asked")
    client = Client.connect(address.logger, timeout_s, config)
    try:
        return client._topic(address.element, lambda _topic: client.close())
    except BaseException:
        client.close()
        raise
