"""A run is handed over as an open file: it arrives whatever becomes of the robot program and of the file's name."""

import mmap
import os
import socket
import subprocess
import sys

import pytest

from silo.errors import ConnectionLostError
from silo.helper import robot_link
from silo.helper.robot_link import RobotLink
from silo.state.handover import ChangeCount, RunOffer, handover_pair, offer_run, taken_runs


@pytest.fixture
def ends():
    ours, theirs = handover_pair()
    with ours, theirs:
        yield ours, theirs


def test_what_is_offered_is_taken_in_its_order(ends, tmp_path):
    ours, theirs = ends
    for number in range(3):
        path = tmp_path / str(number)
        path.write_text(f"run {number}")
        descriptor = os.open(path, os.O_RDONLY)
        assert offer_run(ours, RunOffer(f"id{number}", str(path)), descriptor)
        os.close(descriptor)
        path.unlink()
    taken = taken_runs(theirs)
    assert [offer.run for offer, _ in taken] == ["id0", "id1", "id2"]
    for number, (_, descriptor) in enumerate(taken):
        with os.fdopen(descriptor) as file:
            assert file.read() == f"run {number}"


def test_nothing_offered_is_nothing_taken(ends):
    assert taken_runs(ends[1]) == []


@pytest.mark.slow
def test_a_run_arrives_when_its_program_died_right_after_the_offer(ends, tmp_path):
    ours, theirs = ends
    path = tmp_path / "segment"
    path.write_text("rows")
    program = (
        "import os, signal, socket, sys\n"
        "from silo.state.handover import RunOffer, offer_run\n"
        f"sock = socket.socket(fileno={ours.fileno()})\n"
        "sock.setblocking(False)\n"
        f"assert offer_run(sock, RunOffer('a', {str(path)!r}), os.open({str(path)!r}, os.O_RDONLY))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", program], pass_fds=[ours.fileno()], check=False)
    ours.close()
    ((offer, descriptor),) = taken_runs(theirs)
    assert offer == RunOffer("a", str(path))
    with os.fdopen(descriptor) as file:
        assert file.read() == "rows"
    assert taken_runs(theirs) == []


def test_a_helper_process_that_is_gone_or_takes_nothing_in_holds_nobody_up(ends, tmp_path):
    ours, theirs = ends
    descriptor = os.open(tmp_path, os.O_RDONLY)
    taken = 0
    while offer_run(ours, RunOffer("a" * 4000, ""), descriptor):
        taken += 1
    assert taken > 0
    theirs.close()
    assert not offer_run(ours, RunOffer("a", ""), descriptor)
    os.close(descriptor)


def test_bytes_that_are_no_offer_are_refused(ends):
    ours, theirs = ends
    ours.send(b"nonsense")
    with pytest.raises(ConnectionLostError, match="a run can't be taken over"):
        taken_runs(theirs)


def test_a_note_is_left_to_the_next_helper_process_beside_the_number_of_changes():
    changes = ChangeCount()
    assert changes.left() == b""
    changes.add()
    for note in (b"a longer one", b"short", b"", b"x" * (mmap.PAGESIZE - 16)):
        changes.leave(note)
        follower = ChangeCount(os.dup(changes.descriptor))
        assert (follower.left(), follower.now) == (note, 1)
        follower.close()
    changes.leave(b"x" * (mmap.PAGESIZE - 15))
    assert (changes.left(), changes.now) == (b"", 1)
    changes.close()


def test_a_program_that_tells_nothing_of_a_change_is_waited_for_but_once(monkeypatch):
    """What the clients of a frozen program ask is answered with what is known."""
    changes = ChangeCount()
    link = RobotLink(socket.socketpair()[0], handover_pair()[0], changes)
    link.catch_up()
    changes.add()
    monkeypatch.setattr(robot_link, "TOLD_WITHIN_S", 0.01)
    link.catch_up()
    monkeypatch.setattr(robot_link, "TOLD_WITHIN_S", None)  # for ever
    link.catch_up()
    changes.add()
    link.lost()
    link.catch_up()
    changes.close()
