"""Whatever dead programs left, in any order: all of it is saved, nothing twice, and recovered again nothing changes.

Segments, runs that are held, journals, states of the judge, open parts and lists of files, whole or half written; of
programs of another boot, of another container, or that live. Recovered by the next helper process, by `silo recover`,
or of one folder, in any order in between.
"""

import contextlib
import errno
import fcntl
import os
import shutil
import tempfile
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.conditions import left_captures, state_file
from silo.conditions.state_file import begun_state, store_state
from silo.core.elements import LoggedEvent, LoggerOptions
from silo.core.runtime import boot_id, lock_as_writer, pid_namespace
from silo.files.event_log import add_missing, append_events, event_log_path, read_events
from silo.files.formats import read_recording
from silo.files.parts.scan import scan_part
from silo.helper import left_logs
from silo.helper.dead_robot import OrphanRecovery
from silo.journal.format import Head, free_name
from silo.journal.writer import Disk, JournalWriter
from silo.logger.logger import Logger
from silo.recordings import writing
from silo.recovery.left import save_reader
from silo.recovery.runs import find_all, look_back
from silo.segment.held_runs import held_name, judge_path
from silo.segment.layout import ControlWord
from silo.segment.reader import SegmentReader
from tests.examples import examples

PART = (Path(__file__).parents[1] / "data/golden/read/part.mcap").read_bytes()
SAVE_APART = writing.save_apart
PERIOD = 20  # ticks between two at which the trigger fires
OWNERS = ("another boot", "another container", "lives", "lives in another container")


class Left(RuleBasedStateMachine):
    """A folder of logs, and the runtime folder, beside a book of what is to come of it."""

    def __init__(self):
        super().__init__()
        self.place = Path(tempfile.mkdtemp())
        self.logs, self.runtime = self.place / "logs", self.place / "runtime"
        self.logs.mkdir()
        self.runtime.mkdir(mode=0o700)
        self.patch = pytest.MonkeyPatch()
        self.patch.setenv("SILO_RUNTIME_DIR", str(self.runtime))
        self.patch.setattr(writing, "save_apart", saved_here)
        self.patch.chdir(self.place)
        self.value = self.number = 0
        self.saved: Counter[int] = Counter()  # values that are to stand in logs
        self.fired: Counter[int] = Counter()  # values at which captures are to begin
        self.parts: Counter[str] = Counter()  # messages of parts that are to be closed
        self.stays: dict[Path, bytes] = {}  # of those that live, and what is damaged
        self.open: list[int] = []

    def teardown(self):
        run(["recover", "--look-in", str(self.logs)])
        self.check()
        before = self.listing()
        run(["recover", "--look-in", str(self.logs)])
        self.recover_as_helper()
        assert self.listing() == before
        for descriptor in self.open:
            os.close(descriptor)
        self.patch.undo()
        shutil.rmtree(self.place)

    def listing(self):
        return {str(path): path.stat().st_size for path in self.place.rglob("*") if path.is_file()}

    # ------------------------------------------------------------------------------------------- what is left

    def run_of(self, ticks, *, watched, owner):
        """A run of a program as it left it: its file, and the values that it logged."""
        clock = iter(range(1_700_000_000_000_000_000 + self.value * 1_000_000, 2**62, 1_000_000))
        log = Logger("bot", frequency=1000, folder=self.logs, script=self.logs / "none.yaml", clock=clock.__next__)
        x = log.array("x", (), np.int64, size=1100)
        if watched:
            log.trigger("spike", f"x % {PERIOD} == {PERIOD // 2}", pre="1ms", post="1ms")
        log.start()
        values = list(range(self.value, self.value + ticks))
        self.value += ticks
        for value in values:
            x[...] = value
            log.collect()
        path = Path(log._present.path)
        data = path.read_bytes()
        log.close(discard=True)
        if owner == "another boot":
            data = data.replace(boot_id().encode(), b"0" * len(boot_id()), 1)
        elif "container" in owner:
            here = b'"pid_namespace":%d' % pid_namespace()
            data = data.replace(here, here[:-1] + b"%d" % (9 - int(here[-1:])))
        self.number += 1
        return path.with_name(f"bot.{os.getpid()}.{self.number}.segment"), data, values

    def place_run(self, path, data, owner):
        path.write_bytes(data)
        if owner == "lives in another container":
            self.open.append(os.open(path, os.O_RDWR | os.O_CLOEXEC))
            lock_as_writer(self.open[-1])
        if "lives" in owner:
            self.stays[path] = data

    @rule(
        ticks=st.integers(1, 70),
        owner=st.sampled_from(OWNERS),
        watched=st.booleans(),
        saved=st.booleans(),
        journal=st.booleans(),
    )
    def leave_a_segment(self, ticks, owner, watched, saved, journal):
        path, data, values = self.run_of(ticks, watched=watched, owner=owner)
        self.place_run(path, data, owner)
        with contextlib.closing(SegmentReader(path)) as reader:
            schema = reader.schema
            if watched:
                known = judge_path("bot", schema.run)
                store_state(known, begun_state(schema))
                if "lives" in owner:
                    self.stays[known] = known.read_bytes()
            if journal:
                self.write_journal(path, reader)
            if saved:
                save_reader(reader, self.logs)
                with path.open("r+b") as file:
                    os.pwrite(
                        file.fileno(), ticks.to_bytes(8, "little"), reader.control_offset(ControlWord.SAVED_TICKS)
                    )
        if "lives" in owner:
            self.stays[path] = path.read_bytes()
        self.saved.update(values if saved or "lives" not in owner else ())
        if watched and "lives" not in owner:
            self.fired.update(value for value in fires(values))

    def write_journal(self, segment, reader):
        writer = JournalWriter(free_name(self.logs, reader.schema), Head(str(segment), reader.schema), Disk())
        writer.append(reader)
        writer.close()

    @rule(ticks=st.integers(1, 70))
    def leave_a_journal_alone(self, ticks):
        path, data, values = self.run_of(ticks, watched=False, owner="another boot")
        path.write_bytes(data)
        with contextlib.closing(SegmentReader(path)) as reader:
            self.write_journal(path, reader)
        path.unlink()
        self.saved.update(values)

    @rule(
        ticks=st.integers(1, 70), owner=st.sampled_from(OWNERS[:2]), watched=st.booleans(),
        state=st.sampled_from(["begun", "unseen", "damaged"]),
    )  # fmt: skip
    def leave_a_run_that_is_held(self, ticks, owner, watched, state):
        path, data, values = self.run_of(ticks, watched=watched, owner=owner)
        self.place_run(held_name(path), data, owner)
        with contextlib.closing(SegmentReader(held_name(path))) as reader:
            known = judge_path("bot", reader.schema.run)
            if watched and state == "begun":
                store_state(known, begun_state(reader.schema))
            elif watched and state == "damaged":
                known.write_bytes(b"silo judge 1\nhalf")
        if watched and state != "damaged":
            self.fired.update(fires(values))

    @rule(ticks=st.integers(1, 70), watched=st.booleans())
    def leave_a_state_without_its_run(self, ticks, watched):
        path, data, _ = self.run_of(ticks, watched=True, owner="another boot")
        path.write_bytes(data)
        with contextlib.closing(SegmentReader(path)) as reader:
            store_state(judge_path("bot", reader.schema.run), begun_state(reader.schema))
        path.unlink()

    @rule(ticks=st.integers(1, 70), at=st.floats(0, 1), held=st.booleans())
    def leave_a_damaged_run(self, ticks, at, held):
        path, data, _ = self.run_of(ticks, watched=False, owner="another boot")
        path = held_name(path) if held else path
        path.write_bytes(data[: int(at * 4000)])
        self.stays[path] = path.read_bytes()

    @rule(
        of=st.sampled_from(["1.segment", "1.held.7", "c0ffee.judge.7", "c0ffee.judge", "c0ffee.recorders.7"]),
        written=st.booleans(),
        size=st.integers(0, 5000),
    )
    def leave_what_was_being_made(self, of, written, size):
        self.number += 1
        path = self.runtime / f".bot.{self.number}.{of}.new"
        path.write_bytes(bytes(size))
        if written:
            self.open.append(os.open(path, os.O_RDWR | os.O_CLOEXEC))
            lock_as_writer(self.open[-1])
            self.stays[path] = path.read_bytes()

    @rule(at=st.floats(0, 1), written=st.booleans(), listed=st.booleans())
    def leave_an_open_part(self, at, written, listed):
        self.number += 1
        folder = self.logs / "recordings"
        folder.mkdir(exist_ok=True)
        path = folder / f"robot_20260101_00-00-00_{self.number:05d}.mcap.part"
        path.write_bytes(PART[: int(at * len(PART))])
        if listed:
            (folder / ".silo-1-abcd.part").write_bytes(b'{"recorder": "ro')
        if written:
            self.open.append(os.open(path, os.O_RDWR | os.O_CLOEXEC))
            fcntl.flock(self.open[-1], fcntl.LOCK_EX)
            self.stays[path] = path.read_bytes()
        elif (count := messages(path)) and count > 0:
            self.parts[path.name.removesuffix(".part")] = count

    # ------------------------------------------------------------------------------------------- recovered

    @rule()
    def recover(self):
        damaged = any(path.suffix == ".segment" and data != b"" for path, data in self.stays.items())
        assert run(["recover", "--look-in", str(self.logs)]) in ((0, EXIT_FAILED) if damaged or self.stays else (0,))

    @rule()
    def recover_the_folder(self):
        assert run(["recover", str(self.logs)]) in ((0, EXIT_FAILED) if self.stays else (0,))

    @rule(logger=st.sampled_from(["bot", "another"]))
    def recover_as_helper(self, logger="bot"):
        told: list[str] = []
        options = LoggerOptions(name=logger, folder=str(self.logs))
        replica = SimpleNamespace(now=SimpleNamespace(options=options))
        log = SimpleNamespace(newest=0, add_missing=add_missing)
        events = SimpleNamespace(publish=lambda kind, text, **_: told.append(text), log=log)
        OrphanRecovery(replica, events)._run()
        assert not [text for text in told if "can't be" in text or "not be saved" in text]

    @rule(served=st.booleans())
    def look_back_as_a_start(self, served):
        look_back(LoggerOptions(name="bot", folder=str(self.logs)), served=served)

    def check(self):
        found, captured = Counter[int](), Counter[int]()
        for path in self.logs.glob("bot_*.silo"):
            log = read_recording(path)
            values = log.elements[0].entries[0].values.tolist()
            if (facts := log.conditions.capture) is None:
                found.update(values)
                told = [event.kind for event in log.events]
                assert told.count("started") <= 1
            else:
                captured.update(values[fire - log.offset] for fire in facts.fires)
        assert found == self.saved
        assert captured == self.fired
        events = read_events(self.logs, "bot")
        told = Counter((event.run, event.kind, event.text) for event in events)
        assert [one for one, count in told.items() if count > 1] == []
        assert {path: path.read_bytes() for path in self.stays} == self.stays
        left = {path for path in self.runtime.iterdir() if path.suffix in (".segment", ".held", ".judge", ".new")}
        assert left <= set(self.stays), "nothing that nobody needs is left"
        closed = {path.name: messages(path) for path in (self.logs / "recordings").glob("*.mcap")}
        assert closed == dict(self.parts)
        assert not list(self.logs.rglob(".silo-*"))
        assert not list(self.logs.glob(".*.journal")) or self.stays


def saved_here(reader, folder, types, conditions):
    """In this process, as another one would take half a second each time."""
    return save_reader(reader, folder, types, conditions=conditions)


def fires(values):
    return [value for value in values[1:] if value % PERIOD == PERIOD // 2]


def messages(path):
    """How many messages of samples stand in whole chunks of a part; -1 for what is none."""
    data = path.read_bytes()
    try:
        return sum(scan_part(memoryview(data)).counts.values()) if data else 0
    except Exception:  # noqa: BLE001  # of any damage
        return -1


@pytest.fixture
def left():
    machine = Left()
    yield machine
    machine.teardown()


def test_the_next_helper_process_judges_a_run_that_none_ever_saw(left) -> None:
    left.leave_a_run_that_is_held(50, "another boot", watched=True, state="unseen")
    left.recover_as_helper("another")
    left.recover_as_helper()
    left.check()
    assert len(left.fired) == 2


def test_a_run_that_can_not_be_judged_now_is_held_until_it_can(left) -> None:
    left.leave_a_run_that_is_held(50, "another boot", watched=True, state="unseen")
    planted = event_log_path(left.logs, "bot")
    planted.symlink_to(left.place / "elsewhere")
    left.recover()
    left.recover_as_helper()
    assert ".held" in [path.suffix for path in left.runtime.iterdir()]
    planted.unlink()
    left.recover_as_helper()
    left.check()


def test_a_run_of_which_nobody_can_tell_now_whether_it_was_judged_is_held(left, monkeypatch) -> None:
    left.leave_a_run_that_is_held(50, "another boot", watched=True, state="unseen")
    held = [path for path in left.runtime.iterdir() if path.suffix == ".held"]
    with monkeypatch.context() as unreadable:
        unreadable.setattr(left_captures, "read_events", no_room)
        left_logs.release_left()
    assert held
    assert all(path.exists() for path in held)


@pytest.mark.parametrize("memory_full", [False, True])
@pytest.mark.parametrize("held", [True, False])
def test_a_run_whose_captures_can_not_be_written_now_is_held_until_they_can(left, held, memory_full) -> None:
    if held:
        left.leave_a_run_that_is_held(50, "another boot", watched=True, state="unseen")
    else:
        left.leave_a_segment(50, "another boot", watched=True, saved=False, journal=False)
        left.patch.setattr(left_captures, "_was_served", lambda _: True)
        for path in left.runtime.glob("*.judge"):
            path.unlink()
    with pytest.MonkeyPatch.context() as full:
        full.setattr(left_captures, "write_capture", no_room)
        if memory_full:  # in which the runtime folder is, too
            full.setattr(state_file, "write_private", no_room)
        with contextlib.suppress(AssertionError):  # it tells of what can't be written
            left.recover_as_helper()
    assert ".held" in [path.suffix for path in left.runtime.iterdir()]
    left.recover_as_helper()
    left.check()
    assert len(left.fired) == 2


def no_room(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("journal", [False, True])
def test_what_the_next_helper_process_saves_has_what_happened_in_the_run(left, journal) -> None:
    left.patch.setattr(writing, "save_apart", SAVE_APART)
    if journal:
        left.leave_a_journal_alone(30)
    else:
        left.leave_a_segment(30, "another boot", watched=False, saved=False, journal=False)
    (run,) = {one.schema.run for one in find_all([left.logs]) if one.schema}
    append_events(left.logs, "bot", [LoggedEvent("marker", "fell", 1, 7, 1, "anna", run, 1)])
    left.recover_as_helper()
    (path,) = left.logs.glob("bot_*.silo")
    assert {event.kind for event in read_recording(path).events} == {"started", "marker", "crashed"}


TestLeft = Left.TestCase
TestLeft.settings = settings(max_examples=examples(40), stateful_step_count=6)
