"""A recording that begins under the name of one that a dead program left: that is completed first, whoever comes when.

Nothing here is a matter of luck: who comes first is held up by what it waits for, until the other one is there.
"""

import fcntl
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import psutil
import pytest
from msgspec.structs import replace

from silo.core.elements import RecorderState
from silo.errors import SaveError
from silo.files.manifest import read_written, written_path
from silo.recorder import left_recordings
from silo.recorder.left_recordings import complete_recordings, listed, settle_order
from silo.recorder.orders import RecordOrder
from silo.recorder.process import RecorderHandover, store
from silo.recovery.parts import finished_part
from silo.segment.held_runs import program_of, recorders_path
from silo.segment.reader import SegmentReader
from tests.waiting import DEADLINE_S, freeze, wait_until
from tests.whole_bags import read_bag

pytestmark = pytest.mark.slow

PROGRAM = """
import sys, numpy as np, silo
log = silo.Logger("bot", frequency=1000, max_time=0, folder=sys.argv[1], script=sys.argv[1] + "/none.yaml")
x = log.array("x", (), np.int64, buffer="looping", size=5000)
log.start()
for line in sys.stdin:
    for _ in range(int(line)):
        x[...] += 1
        log.collect()
    print(log._present.path, flush=True)
"""
BEFORE, KILLED_AT, LOGGED = 50, 350, 400  # ticks: when it was ordered, when its recorder was killed, all


class Dead:
    """A program whose recorder was killed, and then itself: it left a part, ticks behind it, and that it recorded."""

    def __init__(self, folder: Path, recorders) -> None:
        self.folder = folder / "rec"
        program = [sys.executable, "-c", PROGRAM, str(folder)]
        with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot:
            self._robot = robot
            self.path = self._ticks(BEFORE)
            with closing(SegmentReader(self.path)) as reader:
                self.run, self.program = reader.schema.run, program_of(reader.schema)
                self.order = RecordOrder("bot", str(self.folder), order="the first", run=self.run, tick=BEFORE)
                recorder = recorders(self.order)
                recorder.follow_run(reader)
                recorder.wait_recording()
            self._ticks(KILLED_AT - BEFORE)
            wait_until(lambda: recorder.reports[-1].samples)
            recorder.kill()
            self._ticks(LOGGED - KILLED_AT)
            robot.kill()
        self.list = recorders_path("bot", self.program.logger_id)
        store(self.list, [RecorderHandover(self.order, "", 0, self.program)])

    def _ticks(self, count: int) -> Path:
        print(count, file=self._robot.stdin, flush=True)
        return Path(self._robot.stdout.readline().strip())


@pytest.fixture
def dead(tmp_path, recorders) -> Dead:
    return Dead(tmp_path, recorders)


class Next:
    """The program that comes after it, and its recorder."""

    def __init__(self, robot, recorders, folder: Path) -> None:
        self._robot, self._recorders, self._folder = robot, recorders, folder / "rec"
        robot.start()
        robot.ticks(20)

    def order(self) -> None:
        """Order that it is recorded from now on."""
        run = self._robot.log._present.run.id
        self.first = self._robot.tick
        self.order = RecordOrder("bot", str(self._folder), order="the second", run=run, tick=self.first)
        self.recorder = self._recorders(self.order)
        self.recorder.follow(self._robot.log)

    def has_ledger(self) -> None:
        """Until its process is where it would take the name: it has looked at the ledger, or waits for it."""
        process = psutil.Process(self.recorder.process.pid)
        wait_until(lambda: [one for one in process.open_files() if one.path.endswith((".recorders", ".recorder.lock"))])

    def check(self, dead: Dead, *, whole: bool = True, had_to_wait: bool = True) -> list[str]:
        """Have it end: each tick of both stands in one part, and the ledger is of its own; returns what was told."""
        self._robot.ticks(100)
        self.recorder.wait_recording()
        self._robot.ticks(100)
        report = self.recorder.finish()
        assert (report.state, report.lost) == (RecorderState.ENDED, 0)
        found = ticks(self._folder)
        assert (found.pop(dead.run) == list(range(BEFORE, LOGGED))) is whole
        ((_, mine),) = found.items()
        first = self.first if had_to_wait else mine[0]  # who begins at once does with what comes from then on
        assert mine == list(range(first, self._robot.tick))
        assert read_written(self._folder, "bot").order == "the second"
        assert not dead.list.exists()
        return [one.told for one in self.recorder.reports if one.told]


@pytest.fixture
def after(robot, recorders, tmp_path) -> Next:
    return Next(robot, recorders, tmp_path)


def ticks(folder: Path) -> dict[str, list[int]]:
    """The ticks of x by run, as the parts have them one after the other."""
    found: dict[str, list[int]] = {}
    for path in sorted(folder.glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2]):
        part = read_bag(path)
        for element in part.elements:
            if element.name == "/log/x":
                of = found.setdefault(finished_part(path).run, [])
                of += (part.offset - len(part.time_ns) + element.stamp_indices).tolist()
    return found


@contextmanager
def beside(work: Callable[[], object]) -> Iterator[threading.Thread]:
    """Do something in a thread meanwhile; it is over at the end of the block."""
    thread = threading.Thread(target=work)
    thread.start()
    yield thread
    thread.join()


def test_what_was_completed_before_is_left_alone(dead, after) -> None:
    assert complete_recordings(lambda *_: None) == []
    after.order()
    assert after.check(dead, had_to_wait=False) == []


def test_who_begins_completes_first_what_nobody_has(dead, after) -> None:
    after.order()
    told = after.check(dead)
    assert any("completed" in one and f"{LOGGED - BEFORE} samples, 0 lost" in one for one in told)
    assert complete_recordings(lambda *_: None) == []


def test_who_begins_waits_for_who_has_claimed_what_the_dead_left(dead, after, monkeypatch) -> None:
    complete_one = left_recordings._complete_one

    def late(*what: object) -> str:
        after.order()
        after.has_ledger()
        return complete_one(*what)

    monkeypatch.setattr(left_recordings, "_complete_one", late)
    assert complete_recordings(lambda *_: None) == []
    assert not [one for one in after.check(dead) if "completed" in one]


def test_who_would_complete_it_waits_for_who_begins(dead, after) -> None:
    with dead.list.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        after.order()
        after.has_ledger()
        with beside(lambda: complete_recordings(lambda *_: None)):
            fcntl.flock(held, fcntl.LOCK_UN)
            after.check(dead)


def test_a_recorder_of_the_dead_that_comes_when_another_one_has_the_name_records_nothing(
    dead, after, recorders
) -> None:
    after.order()
    after.recorder.wait_recording()
    late = recorders(replace(dead.order, resume=True))
    with closing(SegmentReader(dead.path)) as reader:
        late.follow_run(reader)
    report = late.end()
    after.check(dead)
    assert report.state is RecorderState.FAILED
    assert "another recording 'bot' began" in report.text


def test_it_is_told_once_and_let_go_of_where_another_one_has_its_name(dead, after) -> None:
    after.order()
    after.recorder.wait_recording()
    store(dead.list, [RecorderHandover(dead.order, "", 0, dead.program)])  # a copy that somebody put back
    (problem,) = complete_recordings(lambda *_: None)
    assert "another recording 'bot' began" in problem
    assert complete_recordings(lambda *_: None) == []
    after.check(dead)


@pytest.mark.parametrize("then", ["the next recording", "recover"])
def test_who_completes_it_may_be_killed_in_the_midst(dead, after, recorders, then) -> None:
    middle = recorders(replace(dead.order, resume=True))
    with closing(SegmentReader(dead.path)) as reader:
        middle.follow_run(reader)
    wait_until(lambda: len([*dead.folder.glob("*.mcap*")]) > 1)  # it has begun another part
    middle.kill()
    if then == "recover":
        assert complete_recordings(lambda *_: None) == []
    after.order()
    after.check(dead, had_to_wait=then != "recover")


def test_a_new_recorder_that_is_killed_while_it_completes_is_followed_by_one_that_records_from_the_order_on(
    dead, after, recorders
) -> None:
    with dead.list.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        after.order()
        after.has_ledger()
        freeze(after.recorder.process.pid)
        after.recorder.kill()
    after.recorder = recorders(replace(after.order, resume=True))
    after.recorder.follow(after._robot.log)
    after.check(dead)


def test_what_can_not_be_completed_keeps_no_recording_from_its_beginning(dead, after, tmp_path) -> None:
    (tmp_path / "file").touch()
    elsewhere = replace(dead.order, folder=str(tmp_path / "file" / "rec"))
    store(dead.list, [RecorderHandover(elsewhere, "", 0, dead.program)])
    after.order()
    told = after.check(dead, whole=False)
    assert any("can't be completed" in one and "what of it is in no part is not recorded" in one for one in told)
    assert ticks(dead.folder)[dead.run][0] == BEFORE  # the part that it left is closed all the same


def test_an_order_of_a_program_that_lives_is_waited_for_and_not_touched(robot) -> None:
    robot.start()
    with closing(SegmentReader(Path(robot.log._present.path))) as reader:
        program = program_of(reader.schema)
    path = recorders_path("bot", program.logger_id)
    other = RecordOrder("bot", "walks", order="the first")
    store(path, [RecorderHandover(other, "", 0, program)])
    with pytest.raises(SaveError, match="another recorder writes to 'walks' under this name"):
        settle_order("the first", lambda *_: None, 0.0)
    assert listed("the first") is not None
    with beside(lambda: settle_order("the first", lambda *_: None, DEADLINE_S)):
        store(path, [])
    assert listed("the first") is None


def test_who_waited_for_the_name_looks_again_whose_ledger_it_is(dead, after) -> None:
    ledger = written_path(dead.folder, "bot")
    written = ledger.read_bytes()
    ledger.unlink()  # one that begins to record, too, has not written it yet
    with (dead.folder / ".bot.recorder.lock").open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        after.order()
        after.has_ledger()
        ledger.write_bytes(written)
    after.check(dead)
