"""The helper's end of the link: requests to the robot process and its answers, matched by number."""

import concurrent.futures
import itertools
import socket
import threading
from typing import Any, cast

from silo.link.channel import LinkChannel, LinkMessage, LinkReply, LinkRequest
from silo.parameters.requests import ParameterRequests
from silo.rpc.declaring import Do, Done, GoesOn, Reply, Request, request_of, spoken
from silo.rpc.refusals import Refused, RefusedWhy
from silo.state.handover import ChangeCount, RobotState

TOLD_WITHIN_S = 0.5  # a change that was made: longer than its telling takes, shorter than any client waits

DEAD = Refused(RefusedWhy.DEAD, "the robot program is gone; start it again")


class RobotLink(LinkChannel):
    """The robot process, as the helper talks to it. Any thread may ask; the main thread receives."""

    def __init__(self, sock: socket.socket, runs: socket.socket, changes: ChangeCount) -> None:
        super().__init__(sock)
        self.runs = runs
        self.leave, self.left = changes.leave, changes.left
        self._changes = changes
        self._known = 0  # changes that were told, or that were waited for in vain
        self._more_is_known = threading.Condition()
        self._sending = threading.Lock()
        self._numbers = itertools.count(1)
        self._pending: dict[int, concurrent.futures.Future[Reply]] = {}
        self._late: dict[int, Request[Any]] = {}  # whose clients were told that they go on
        self._gone = False

    def took(self, state: RobotState) -> None:
        """Have those go on who wait for a change that this state tells of, which everybody can see now."""
        with self._more_is_known:
            self._known = max(self._known, state.changes)
            self._more_is_known.notify_all()

    def catch_up(self) -> None:
        """Wait until what the robot program changed before this call is known here; one that is frozen tells nothing.

        In vain for `TOLD_WITHIN_S`, and for the same change but once. Never for the main thread, which takes states in.
        """
        changes = self._changes.now
        with self._more_is_known:
            if not self._more_is_known.wait_for(lambda: self._known >= changes or self._gone, TOLD_WITHIN_S):
                self._known = max(self._known, changes)

    def tell(self, message: LinkMessage) -> bool:
        """Send a message; False if the robot process is gone."""
        with self._sending:
            try:
                self.send(message)
            except OSError:
                return False
        return True

    def end_excitation(self, limit: str) -> None:
        """Have the robot process end what it excites, if anything: a limit fired. Waits for no answer."""
        request = request_of(ParameterRequests._stop_excitation, why=f"limit: {limit}")
        self.tell(LinkRequest(self.number(), cast("Do[Any]", request)))

    def number(self) -> int:
        """Return a number by which an event can tell how something ended."""
        return next(self._numbers)

    def ask(self, request: Request[Any], timeout_s: float) -> Reply:
        """Have the robot process do something and wait for its answer; what takes longer goes on."""
        assert isinstance(request, Do)
        number = self.number()
        future: concurrent.futures.Future[Reply] = concurrent.futures.Future()
        self._pending[number] = future
        if self._gone or not self.tell(LinkRequest(number, request)):
            self._pending.pop(number, None)
            return DEAD
        try:
            return future.result(timeout_s)
        except concurrent.futures.TimeoutError:
            self._late[number] = request  # before it is taken from the others: an answer finds it in one of both
            if self._pending.pop(number, None) is None:
                self._late.pop(number, None)
                return future.result()  # it came right now
        return GoesOn(
            number,
            f"{spoken(request)} goes on: the robot program has not answered for {timeout_s:.3g} s (it "
            "has much to do, is stopped, or is busy in code that holds the interpreter); the status, and an event, "
            "tell how it ends",
        )

    def answered(self, message: LinkReply) -> Request[Any] | None:
        """Hand an answer to the thread that waits for it; return the request whose answer nobody waits for any more.

        For the main thread.
        """
        future = self._pending.pop(message.number, None)
        if future is not None:
            future.set_result(message.reply)
        return self._late.pop(message.number, None)

    def lost(self) -> None:
        """The link ended: everybody who waits gets a refusal. For the main thread."""
        with self._more_is_known:
            self._gone = True
            self._more_is_known.notify_all()
        self._late.clear()
        for number in list(self._pending):
            future = self._pending.pop(number, None)
            if future is not None:
                future.set_result(DEAD)


def ending(request: Request[Any], reply: Reply | bytes) -> str:
    """Return how a request ended that its client could not wait for."""
    what = f"the {spoken(request)} that took long"
    if isinstance(reply, Refused):
        return f"{what} was refused: {reply.text}"
    more = f"; {reply.text}" if isinstance(reply, Done) and reply.text else ""
    return f"{what} is done{more}"
