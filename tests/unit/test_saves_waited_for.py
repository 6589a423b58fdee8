"""What a client that waits for a save is told, and what is asked of many loggers at once."""

import contextlib
import threading
from types import SimpleNamespace

import pytest

from silo.client import saves
from silo.client.bulk import Outcome, outcomes
from silo.client.saves import Saves
from silo.core.elements import FileType, SavedFile
from silo.errors import ConnectionLostError, SaveError
from silo.net.found import LoggerAddress
from silo.rpc.published import Event, EventKind
from tests.waiting import DEADLINE_S

FILE = SavedFile("run.silo", FileType.SILO, 7)


def event(kind, job=1, **more):
    return Event(1, 0, kind, more.pop("text", ""), job=job, **more)


def test_how_far_a_save_is_is_told_as_it_goes_on_and_its_files_at_the_end():
    made, told = Saves(), []
    to_come = [event(EventKind.SAVING, progress=at) for at in (0.25, 0.5, 0.5, 0.75)]
    to_come.append(event(EventKind.SAVED, progress=1.0, files=[FILE]))

    def connected():
        made.note(to_come.pop(0))
        return True

    made.note(event(EventKind.SAVED, job=2))
    made.note(event(EventKind.STARTED, job=0))
    assert made.wait(1, DEADLINE_S, told.append, connected) == [FILE]
    assert told == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize(
    ("noted", "timeout_s", "connected", "error", "words"),
    [
        ([event(EventKind.SAVE_FAILED, text="the disk is full")], DEADLINE_S, True, SaveError, "the disk is full"),
        ([], -1.0, True, SaveError, "the save isn't done after -1 s; it goes on in the helper process"),
        ([event(EventKind.SAVING)], -1.0, True, SaveError, "the save isn't done after -1 s; it goes on in the "
         "helper process"),
        ([event(EventKind.SAVING)], DEADLINE_S, False, ConnectionLostError,
         "the connection was lost while the log was being saved; look into its folder"),
        ([event(EventKind.SAVED), None], -1.0, True, SaveError, "the save isn't done after -1 s; it goes on in "
         "the helper process"),  # of the helper process before
    ],
)  # fmt: skip
def test_a_save_that_does_not_come_to_its_end_is_told_of(noted, timeout_s, connected, error, words):
    made = Saves()
    for one in noted:
        made.note(one) if one else made.note_link(connected=True)
    with pytest.raises(error) as caught:
        made.wait(1, timeout_s, None, lambda: connected)
    assert str(caught.value) == words


def test_the_newest_saves_are_known_and_a_lost_link_forgets_none(monkeypatch):
    monkeypatch.setattr(saves, "MAX_SAVES", 2)
    made = Saves()
    for job in (1, 2, 3):
        made.note(event(EventKind.SAVED, job=job, files=[FILE]))
    made.note_link(connected=False)
    assert [made.wait(job, DEADLINE_S, None, lambda: False) for job in (2, 3)] == [[FILE], [FILE]]
    with pytest.raises(ConnectionLostError):
        made.wait(1, DEADLINE_S, None, lambda: False)


def test_a_link_that_is_back_before_anybody_looked_is_lost_for_who_waits():
    made = Saves()

    def back_at_once():
        made.note_link(connected=False)
        made.note_link(connected=True)
        return True

    made.note(event(EventKind.SAVING))
    with pytest.raises(ConnectionLostError, match="look into its folder"):
        made.wait(1, 1.0, None, back_at_once)


def test_each_of_many_loggers_has_its_answer_whatever_becomes_of_the_others(monkeypatch):
    together = threading.Barrier(3, timeout=DEADLINE_S)

    def job(client):
        together.wait()
        if client.name == "refused":
            raise SaveError("the disk\n is full")
        if client.name == "wrong":
            raise KeyError("x")
        return f"saved {client.name}", (FILE,)

    def connect(found, *, read_only):
        return contextlib.nullcontext(SimpleNamespace(name=found.name))

    monkeypatch.setattr("silo.client.bulk.Client.connect", connect)
    loggers = [LoggerAddress(name, 1, "", "ann") for name in ("fine", "refused", "wrong")]
    assert sorted(outcomes(loggers, job, read_only=False), key=lambda one: one.place) == [
        Outcome(0, True, "saved fine", (FILE,)),
        Outcome(1, False, "the disk is full"),
        Outcome(2, False, "KeyError: 'x'"),
    ]
