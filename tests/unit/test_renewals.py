"""What a client renews, and when it stops: answers of a helper process, one after the other."""

from collections import deque

import msgspec
import pytest

from silo.client.renewals import ControlLease, Renewals
from silo.control.authentication import Sender
from silo.control.requests import TakeControl
from silo.control.server import CONTROL, ControlLock
from silo.live.feeds import LEASE_S
from silo.net.keys import Root
from silo.rpc.declaring import Done
from silo.rpc.leases import Leases
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError


class Answered:
    """A request that was answered at once."""

    def __init__(self, reply) -> None:
        self._reply = reply

    def poll(self):
        return True, msgspec.msgpack.encode(self._reply)


class Link:
    """A connection of which the helper process gives these answers."""

    sessions, connected = 1, True

    def __init__(self, *replies) -> None:
        self.replies, self.asked = deque(replies), []

    def ask_later(self, request, timeout_s):
        self.asked.append(request)
        return Answered(self.replies.popleft())


def renewed(link: Link, lost: list[str]) -> None:
    """Renew control until there is no answer left, or nothing is asked any more."""
    renewals, held = Renewals(link, lambda: "me"), ControlLease(TakeControl(lease_s=15.0, renew=True), lost.append)
    renewals.add(held)
    for _ in range(2 * len(link.replies)):
        if not link.replies:
            break
        renewals.renew_soon(held)
        renewals.renew()
        renewals.renew()


def test_control_that_somebody_else_has_is_renewed_no_more_and_told_once() -> None:
    link, lost = Link(Done(), Refused(RefusedWhy.CONTROL, "bob has control"), Done()), []
    renewed(link, lost)
    assert (len(link.asked), lost) == (2, ["bob has control"])


def test_control_whose_renewal_only_came_too_late_is_renewed_again() -> None:
    link, lost = Link(Done(), Refused(RefusedWhy.LATE, "its turn did not come in time"), Done(), Done()), []
    renewed(link, lost)
    assert (len(link.asked), lost) == (4, [])


# ---------------------------------------------------------------------------------------- in the helper process


class Told:
    """Events as texts."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def publish(self, _kind, text: str, by: str = "") -> None:
        self.texts.append(text)


def test_that_control_ended_by_itself_is_told_before_that_somebody_else_took_it() -> None:
    clock, told = [0.0], Told()
    control_lock = ControlLock(told, None, Root("here", "robot"), "robot.1")
    control_lock._leases = Leases(clock=lambda: clock[0])
    anna, bob = Sender("anna", "anna from desk1"), Sender("bob", "bob from desk2")
    control_lock.take(TakeControl(lease_s=2.0), anna)
    clock[0] = 2.5
    assert control_lock.control is None
    control_lock.take(TakeControl(lease_s=2.0), bob)
    control_lock.watch()
    assert told.texts == [
        "control taken", "control of anna from desk1 ended: nobody renewed it", "control taken",
    ]  # fmt: skip
    assert control_lock._leases.find(CONTROL).owner == "bob"
    control_lock.release(bob)
    control_lock.watch()
    assert told.texts[3:] == ["control released"]


def test_control_that_was_given_up_is_not_taken_again_by_a_renewal_of_the_same_user() -> None:
    told = Told()
    control_lock = ControlLock(told, None, Root("here", "robot"), "robot.1")
    terminal, shell = Sender("anna", "anna from desk1, silo-tui 1"), Sender("anna", "anna from desk1, silo 2")
    control_lock.take(TakeControl(), terminal)
    control_lock.take(TakeControl(renew=True), terminal)
    control_lock.release(shell)
    with pytest.raises(RequestRefusedError, match="was given up by anna from desk1, silo 2: take it again") as refused:
        control_lock.take(TakeControl(renew=True), terminal)
    assert refused.value.why is RefusedWhy.CONTROL
    assert control_lock.control is None
    control_lock.take(TakeControl(), terminal)  # by hand
    assert told.texts == ["control taken", "control released", "control taken"]
    # a helper process that has just begun knows of nobody, and is told by a renewal
    after = ControlLock(told, None, Root("here", "robot"), "robot.1")
    after.take(TakeControl(renew=True), terminal)
    assert after.control.identity == "anna"


def test_a_lease_is_renewed_three_times_before_it_ends(monkeypatch) -> None:
    link, now_s = Link(Done(), Done()), 100.0
    monkeypatch.setattr("silo.client.renewals.time.monotonic", lambda: now_s)
    renewals = Renewals(link, lambda: "me")
    renewals.add(ControlLease(TakeControl(lease_s=15.0, renew=True), print))
    renewals.renew()
    for asked in (1, 2):
        now_s += LEASE_S / 3 + 0.01
        renewals.renew()
        renewals.renew()
        assert len(link.asked) == asked
