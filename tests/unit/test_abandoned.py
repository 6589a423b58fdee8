"""Child processes that were frozen and whose parents died: they alone are ended, by whoever waits for their locks."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing
from pathlib import Path

import msgspec
import pytest

from silo.core.child import Holder, end_abandoned_holder
from silo.core.runtime import boot_id, pid_namespace, process_facts, process_start
from silo.files.atomic import claimed
from silo.files.manifest import Ledger
from tests.waiting import freeze, wait_until

pytestmark = pytest.mark.slow

LEDGER = """
from silo.files.manifest import Ledger
held = Ledger(folder, "bot", 0.0, parent)
"""
CLAIM = """
from silo.core.child import note_holder
from silo.files.atomic import claimed
held = claimed(folder, "capture 1", 0.0)
note_holder(held.__enter__(), parent)
"""
HOLDS = """
import sys
from pathlib import Path
folder, parent = Path(sys.argv[1]), int(sys.argv[2])
{}
print("holds", flush=True)
sys.stdin.read()
"""
Frozen = subprocess.Popen[str]
NOBODY = os.getpid() + 1  # that is nobody's parent here


@pytest.fixture
def frozen(tmp_path: Path) -> Iterator[Callable[[str, int], Frozen]]:
    """One that stands still and holds something, and whom it calls its parent."""
    begun: list[Frozen] = []

    def hold(what: str, parent: int) -> Frozen:
        command = [sys.executable, "-c", HOLDS.format(what), str(tmp_path), str(parent)]
        begun.append(one := subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        assert one.stdout is not None
        assert one.stdout.readline() == "holds\n"
        freeze(one.pid)
        return one

    yield hold
    for one in begun:
        with one:
            one.kill()


def ends(path: Path, holder: Holder) -> bool:
    path.write_bytes(msgspec.json.encode(holder))
    with path.open("rb") as file:
        return end_abandoned_holder(file.fileno())


@pytest.mark.parametrize(
    ("what", "take"),
    [
        (LEDGER, lambda folder: closing(Ledger(folder, "bot", 60.0, os.getpid()))),
        (CLAIM, lambda folder: claimed(folder, "capture 1", 60.0)),
    ],
)
def test_one_that_is_frozen_and_whose_parent_is_gone_keeps_nobody_waiting(
    frozen: Callable[[str, int], Frozen],
    tmp_path: Path,
    what: str,
    take: Callable[[Path], AbstractContextManager[object]],
) -> None:
    one = frozen(what, NOBODY)
    with take(tmp_path):
        assert one.wait() == -signal.SIGKILL


def test_any_other_is_left_alone(frozen: Callable[[str, int], Frozen], tmp_path: Path) -> None:
    one = frozen(LEDGER, os.getpid())
    path = tmp_path / ".bot.recorder.lock"
    told = msgspec.json.decode(path.read_bytes(), type=Holder)
    assert told == Holder(one.pid, process_start(one.pid), os.getpid(), boot_id(), pid_namespace())
    assert not ends(path, told), "its parent lives"
    abandoned = msgspec.structs.replace(told, parent=NOBODY)
    for other in ({"start": told.start + 1}, {"boot_id": "before"}, {"pid_namespace": 1}):  # its pid was another's
        assert not ends(path, msgspec.structs.replace(abandoned, **other)), other
    path.write_bytes(b"")  # as an older silo left it
    with path.open("rb") as file:
        assert not end_abandoned_holder(file.fileno())
    one.send_signal(signal.SIGCONT)
    wait_until(lambda: process_facts(one.pid)[0] != "T")
    assert not ends(path, abandoned), "it runs"
    assert one.poll() is None
    freeze(one.pid)
    assert ends(path, abandoned)
    assert not ends(path, abandoned), "it is gone"
