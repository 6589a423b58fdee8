"""Who has control: one operator at a time, where somebody took it or the program wants it so.

Control is leased: it ends with a client that dies, or whose link does. A helper process leaves it to the one that
follows it, with what is left of its time.
"""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from silo.control import requests
from silo.control.requests import LONGEST_LEASE_S, TakeControl
from silo.core.elements import Control
from silo.core.quantities.writing import duration
from silo.decoding import msgpack_decoder
from silo.net.access.senders import came_by_network, name_of
from silo.net.keys import Root
from silo.rpc.declaring import Do, Request
from silo.rpc.leases import Lease, Leases
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Sender, Server, Turn
from silo.state.events import EventNotifier, plain
from silo.state.replica import Replica

CONTROL = "control"
GIVEN_S = 60.0  # in which whom it is given to must renew it


class LeftControl(msgspec.Struct, frozen=True):
    """Control as it is left to the next helper process: until when by the clock of all processes of this computer."""

    control: Control
    ends_s: float


_decoder = msgpack_decoder(LeftControl)


class ControlLock:
    """Whose changes are done now. Any thread may ask."""

    def __init__(
        self,
        events: EventNotifier,
        replica: Replica,
        root: Root,
        label: str,
        *,
        one: bool = False,
        closed: Callable[[], str] = str,
        leave: Callable[[bytes], None] = lambda _: None,
        left: bytes = b"",
    ) -> None:
        """`label` means the logger among those of this computer. `one`: nothing is changed but by who has control;
        `closed` tells why nothing is from the network, if so. `leave` takes what is `left` to the next helper process.
        """
        self.closed, self.one = closed, one
        self._events, self._replica, self._logger = events, replica, root.logger
        self._root, self._label = root, label
        self._leases: Leases[str, Control] = Leases()  # of one thing: control
        self._released: dict[str, str] = {}  # by whom it was given up, by the words of who did
        self._leave = leave
        if left:
            with contextlib.suppress(msgspec.MsgspecError):  # of another silo: the program goes on with a new one
                before = _decoder.decode(left)
                self._leases.set(CONTROL, before.control, before.ends_s - time.monotonic(), before.control.identity)

    @property
    def control(self) -> Control | None:
        """Who has control now."""
        return self._leases.get(CONTROL)

    def watch(self) -> None:
        """Tell of a lease that ended by itself."""
        for one in self._leases.expire():
            self._tell(f"control of {one.value.who} ended: nobody renewed it", one.value.who)

    def check(self, request: Request[Any], sender: Sender) -> None:
        """Raise RequestRefusedError for a change that is not done now."""
        if not (isinstance(request, Do) and request.needs_control):
            return
        lease = self._leases.find(CONTROL)
        if lease is None and self.one:
            text = (
                f'changes of {self._logger} need control (the program says so: log.serve(control="one")), and nobody '
                f"has it: `silo control take {self._meant(sender)}`; nothing was changed"
            )
            raise RequestRefusedError(RefusedWhy.CONTROL, text)
        if lease is not None and lease.owner != sender.identity:
            raise RequestRefusedError(RefusedWhy.CONTROL, self._taken(lease, sender))

    def take(self, request: TakeControl, sender: Sender) -> str:
        """Give control to who asks for it, unless somebody else has it."""
        if not 1.0 <= request.lease_s <= LONGEST_LEASE_S:  # False for NaN
            text = f"the lease of control must be 1 s to {LONGEST_LEASE_S:g} s, got {request.lease_s:g} s"
            raise RequestRefusedError(RefusedWhy.INVALID, f"{text}; nothing was changed")
        with self._leases:
            before = self._leases.find(CONTROL)
            mine = before is not None and before.owner == sender.identity
            if before is not None and not mine and (request.renew or not request.force):
                raise RequestRefusedError(RefusedWhy.CONTROL, self._taken(before, sender))
            if before is None and request.renew and (who := self._released.get(sender.identity)):
                text = f"control of {self._logger} was given up by {who}: take it again where you want it"
                raise RequestRefusedError(RefusedWhy.CONTROL, text)
            self._released.pop(sender.identity, None)
            self._hold(sender.identity, sender.words, request.lease_s, before if mine else None)
        if not mine:
            self.watch()  # first what ended by itself
            taken = f" from {before.value.who}" if before is not None else ""
            self._tell(f"control taken{taken}", sender.words)
        ends = f"it ends in {duration(request.lease_s)} unless it is renewed"  # silo-tui renews, a command doesn't
        return f"you have control of {self._logger} until you release it; {ends}"

    def release(self, sender: Sender) -> str:
        """Let go of control."""
        with self._leases:
            before = self.control
            if before is not None and before.identity != sender.identity:
                text = f"{before.who} has control of {self._logger}, not you; nothing was changed"
                raise RequestRefusedError(RefusedWhy.CONTROL, text)
            if before is not None:
                self._leases.drop(CONTROL)
                self._leave(b"")
                self._released[sender.identity] = sender.words  # its other programs don't renew it
        if before is None:
            return f"nobody had control of {self._logger}"
        self._tell("control released", sender.words)
        return f"control of {self._logger} is released"

    def give(self, to: str, sender: Sender) -> str:
        """Hand control over to a user who is connected and was let in."""
        with self._leases:
            before = self.control
            known = {one.identity: one for one in self._replica.clients if one.identity}
            names = {name_of(identity): identity for identity in known}
            identity = to if to in known else names.get(to, "")
            if before is not None and before.identity != sender.identity:
                text = f"{before.who} has control of {self._logger}, so it isn't yours to give; nothing was changed"
                raise RequestRefusedError(RefusedWhy.CONTROL, text)
            if not identity:
                others = ", ".join(sorted(names)) or "nobody"
                text = (
                    f"no operator '{plain(to)}' is connected to {self._logger} (there: {others}): who is to "
                    "have control connects first (silo-tui, silo watch); nothing was changed"
                )
                raise RequestRefusedError(RefusedWhy.NOT_FOUND, text)
            self._hold(identity, known[identity].who, GIVEN_S)
            words = known[identity].who
        self._tell(f"control given to {words}", sender.words)
        return f"{words} has control of {self._logger}"

    def _hold(self, identity: str, who: str, lease_s: float, mine: Lease[str, Control] | None = None) -> None:
        """Give control to somebody, or renew what is theirs, which never makes it shorter."""
        if mine is not None:
            lease_s = max(lease_s, mine.ends_s - time.monotonic())
        now_ns = time.time_ns()
        since_ns = mine.value.since_ns if mine is not None else now_ns
        control = Control(who, identity, since_ns, now_ns + round(lease_s * 1e9))
        self._leases.set(CONTROL, control, lease_s, identity)
        self._leave(msgspec.msgpack.encode(LeftControl(control, time.monotonic() + lease_s)))

    def _tell(self, text: str, by: str) -> None:
        self._events.publish(EventKind.CONTROL, text, by=by)

    def _meant(self, sender: Sender) -> str:
        """Return what means this logger and no other where its sender types it."""
        return self._root.address if came_by_network(sender.words) else self._label

    def _taken(self, lease: Lease[str, Control], sender: Sender) -> str:
        who, logger = lease.value.who, self._logger
        since = duration(max(0.0, (time.time_ns() - lease.value.since_ns) / 1e9))
        left = duration(max(0.0, lease.ends_s - time.monotonic()))
        return (
            f"{who} has control of {logger} since {since}: ask for it (`silo control give {self._root.address} "
            f"{name_of(sender.identity)}` over there), wait (without a renewal it ends in {left}), or take it, which "
            f"everybody is told: `silo control take {self._meant(sender)} --force`; nothing was changed"
        )


@dataclass(frozen=True)
class ControlServer(Server, does=[requests]):
    """Gives control, and takes it back."""

    control_lock: ControlLock

    def take_control(self, turn: Turn, request: TakeControl) -> str:
        return self.control_lock.take(request, turn.sender)

    def release_control(self, turn: Turn) -> str:
        return self.control_lock.release(turn.sender)

    def give_control(self, turn: Turn, to: str) -> str:
        return self.control_lock.give(to, turn.sender)
