"""A run that is cut: changed while it goes on, tick by tick, in another stretch."""

import errno
import gc
import itertools
import linecache
import re
import sys
import threading
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import silo
from silo.analysis.stretches import joined
from silo.core.elements import BufferType, Edit, LoggedEvent, Storage, Stretch
from silo.core.recording import Recording
from silo.errors import ElementError, SaveError, SegmentError, StateError, UnsavedError
from silo.helper import dead_robot
from silo.helper.journaling import Journaling
from silo.journal.format import list_journals
from silo.journal.holdings import segment_holdings
from silo.journal.reader import JournalReader
from silo.logger import current_run
from silo.logger.current_run import MOST_CUT_OFF, MOST_ELEMENTS, CurrentRun
from silo.loop.run import Run
from silo.rpc.published import EventKind
from silo.segment.reader import SegmentReader
from tests.stand_ins.saved import element
from tests.stand_ins.ticking import turning
from tests.waiting import DEADLINE_S, wait_until


class Loop:
    """A logger with a counter, and `collect` as a program calls it."""

    def __init__(self, logger, kept=False) -> None:
        self.logger, self.ticks = logger, 0
        self.counter = logger.array("n", (), "int64", buffer="growing")
        self.other = logger.array("x", buffer="growing")
        logger.start()
        self._kept = logger.collect if kept else None

    def turn(self, times=1) -> None:
        for _ in range(times):
            self.counter[...] = self.ticks
            self.other[...] = self.ticks
            (self._kept or self.logger.collect)()
            self.ticks += 1

    def whole(self, folder):
        """What the files hold, as one log: each tick once."""
        log = silo.open_log(folder)
        assert log["n"].values.tolist() == list(range(self.ticks))
        assert log["x"].values.tolist() == np.sort(log["x"].values).tolist()
        stamps = dict(zip(log["n"].values.tolist(), log["n"].time_ns.tolist(), strict=True))
        assert log["x"].time_ns.tolist() == [stamps[int(tick)] for tick in log["x"].values], (
            "each at the time of its tick"
        )
        assert not log.recording.warnings
        return log


def held(logger):
    """What a refused cut must leave as it is."""
    return logger._table.state, logger._present.run, logger._present.stretches, logger.ticks, logger.is_running


@pytest.mark.parametrize("options", [{}, {"timing": True}, {"threads": "serialized"}, {"storage": "file"}], ids=str)
@pytest.mark.parametrize("kept", [False, True])
def test_a_loop_that_is_cut_again_and_again_has_every_tick_once(new_logger, tmp_path, options, kept):
    logger = new_logger(frequency=1000, **options)
    loop = Loop(logger, kept)
    with turning(loop.turn, 0.0005):
        for cut in range(3 * MOST_CUT_OFF + 5):
            ticks = loop.ticks
            wait_until(lambda ticks=ticks: loop.ticks > ticks + 2)
            if len(logger._present.cut_off) == MOST_CUT_OFF:
                logger.save()
            assert logger.set("x", divider=2 + cut % 2, cut=True) == 1
    assert logger.ticks == loop.ticks
    logger.save()
    assert not logger.has_unsaved
    log = loop.whole(tmp_path)
    told = [event.text for event in log.recording.events if event.kind == "cut"]
    assert len(told) == 3 * MOST_CUT_OFF + 5
    assert told[:3] == ["/log/x divider 1 -> 2", "/log/x divider 2 -> 3", "/log/x divider 3 -> 2"]


def test_a_cut_within_a_tick_counts_that_tick_once(new_logger, tmp_path):
    asked, loggers = [], []

    def clock():
        ticks = loggers[0].ticks if loggers else 0
        if ticks == 3 and not asked:
            asked.append(threading.Thread(target=lambda: logger.set("x", size=7, cut=True)))
            asked[0].start()
            asked[0].join()
        return 1000 * ticks

    logger = new_logger(clock=clock)
    loggers.append(logger)
    loop = Loop(logger)
    loop.turn(6)
    assert [run.segment.ticks for run in logger._present.stretches] == [4, 2]
    logger.save()
    loop.whole(tmp_path)


def test_a_tick_that_fills_the_buffers_while_it_is_cut_ends_nothing(new_logger, tmp_path):
    asked, loggers = [], []

    def clock():
        ticks = loggers[0].ticks if loggers else 0
        if ticks == 3 and not asked:
            asked.append(threading.Thread(target=lambda: logger.set("/", buffer="growing", cut=True)))
            asked[0].start()
            asked[0].join()
        return 1000 * ticks

    logger = new_logger(clock=clock)
    loggers.append(logger)
    logger.add(lambda: 0.0, "y", size=4, buffer="fixed")
    logger.add(lambda: 0.0, "z", size=4, buffer="fixed")
    logger.start()
    for _ in range(6):
        logger.collect()
    assert (logger.is_running, logger.ticks) == (True, 6)
    logger.save()
    assert len(silo.open_log(tmp_path)["y"].values) == 6


def test_a_run_that_stops_by_itself_just_before_the_cut_stays_stopped_and_whole(new_logger, tmp_path, monkeypatch):
    logger = new_logger()
    logger.add(lambda: 0.0, "y", size=4, buffer="fixed")
    logger.start()
    logger.collect()
    prepare = CurrentRun.prepare

    def meanwhile(present, make):
        made = prepare(present, make)
        for _ in range(3):
            logger.collect()
        return made

    monkeypatch.setattr(CurrentRun, "prepare", meanwhile)
    state = logger._table.state
    with pytest.raises(StateError, match=r"stopped by itself.*nothing was changed"):
        logger.set("y", size=9, cut=True)
    logger.collect()
    assert (logger._table.state, logger.is_running, logger.ticks) == (state, False, 4)
    assert "stopped by itself" in logger.stop_reason
    logger.save()
    (file,) = tmp_path.glob("*.silo")
    assert len(silo.open_log(file)["y"].values) == 4


@contextmanager
def while_prepared(monkeypatch, do):
    """Have another thread do something while the next stretch is prepared, which takes no longer for that."""
    prepare, errors = CurrentRun.prepare, []

    def caught():
        try:
            do()
        except Exception as error:  # noqa: BLE001 the test raises it
            errors.append(error)

    def prepare_meanwhile(present, make):
        made = prepare(present, make)
        thread = threading.Thread(target=caught)
        thread.start()
        thread.join(DEADLINE_S)
        assert not thread.is_alive(), "it waited for the stretch"
        return made

    with monkeypatch.context() as patch:
        patch.setattr(CurrentRun, "prepare", prepare_meanwhile)
        yield
    if errors:
        raise errors[0]


class Awaited:
    """A lock, and whether a thread came to wait for it."""

    def __init__(self, lock):
        self._lock, self.waits = lock, threading.Event()

    def __enter__(self):
        self.waits.set()
        self._lock.acquire()

    def __exit__(self, *error):
        self._lock.release()


def test_nobody_waits_for_a_stretch_that_is_prepared_and_what_others_changed_meanwhile_stays(
    new_logger, tmp_path, monkeypatch
):
    logger = new_logger(threads="serialized")
    logger.parameter("kp", 1.0)
    loop = Loop(logger)
    loop.turn(3)

    def look_and_change():
        assert logger["x"].newest == 2.0
        assert (logger["x"].options.divider, logger.is_running) == (1, True), "it is changed at the cut"
        logger.save(folder=tmp_path / "meanwhile")
        logger.limit("x", (-1, 0, 1, 2))
        logger.derive("twice", "2 * x")
        logger.parameters.set({"kp": 2.0})
        loop.turn(2)

    revision = logger._table.revision
    with while_prepared(monkeypatch, look_and_change):
        assert logger.set("x", divider=2, cut=True) == 1
    assert logger._table.revision == revision + 2, "of the derived signal, and of the element"
    assert [one.name for one in logger._conditions.now.limits] == ["x"]
    loop.turn(3)
    logger.save()
    log = loop.whole(tmp_path)
    kp = [list(log.parameters.at(time_s).values()) for time_s in log.times]
    assert kp == [[1.0]] * 3 + [[2.0]] * 5
    part = silo.open_log(next(tmp_path.glob("*_part2.silo")), alone=True)
    assert [list(part.parameters.at(time_s).values()) for time_s in part.times] == [[2.0]] * 3
    assert [event.change.values for event in part.parameters.changes] == [(("/log/kp", 1.0, 2.0),)]


def test_what_others_changed_meanwhile_is_not_replaced_by_a_script(new_logger, tmp_path, monkeypatch):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn()
    (script := tmp_path / "walk.yaml").write_text(
        "log_elements: [{name: /log/x, divider: 3}]\ntriggers: [{name: late, when: n > 300}]\n"
    )
    before = held(logger)
    with (
        while_prepared(monkeypatch, partial(logger.trigger, "early", "n > 1")),
        pytest.raises(StateError, match=r"triggers .* were changed by others .* nothing was changed, try again"),
    ):
        logger.load_script(script, cut=True)
    assert held(logger) == before
    assert [one.name for one in logger._conditions.now.triggers] == ["early"]
    assert logger.load_script(script, cut=True) == []
    assert [one.name for one in logger._conditions.now.triggers] == ["late"]


def test_a_logger_is_stopped_while_a_stretch_is_prepared_and_the_next_start_has_no_more_of_it(
    new_logger, runtime_folder, monkeypatch
):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(2)
    state = logger._table.state
    began = []

    def stop_and_start():
        logger.stop()
        assert not logger.is_running
        starting = threading.Thread(target=lambda: began.append(logger.start(unsaved="save")))
        logger._life.cutting = cutting = Awaited(logger._life.cutting)
        starting.start()
        assert cutting.waits.wait(DEADLINE_S)
        began.append(starting)

    with (
        while_prepared(monkeypatch, stop_and_start),
        pytest.raises(StateError, match=r"just when it was to be cut: nothing was changed"),
    ):
        logger.set("x", divider=2, cut=True)
    began[0].join()
    assert (began[1:], logger._table.state, logger.is_running, logger.ticks) == ([None], state, True, 0)
    loop.turn()
    assert [path.name for path in runtime_folder.glob("*.segment")] == [logger._present.run.segment.path.name]


@pytest.mark.parametrize("does", ["start", "set"])
def test_what_interrupts_a_thread_that_prepares_a_stretch_does_not_wait_for_it(new_logger, monkeypatch, does):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(2)
    prepare = CurrentRun.prepare

    def interrupted(present, make):  # as by a handler of a signal
        monkeypatch.setattr(CurrentRun, "prepare", prepare)
        made = prepare(present, make)
        if does == "set":
            logger.limit("x", (-1, 0, 1, 2))
        else:
            logger.stop()
            logger.start()
        return made

    monkeypatch.setattr(CurrentRun, "prepare", interrupted)
    if does == "set":
        assert logger.set("x", divider=2, cut=True) == 1
    else:
        with pytest.raises(StateError, match="just when it was to be cut: nothing was changed"):
            logger.set("x", divider=2, cut=True)
    assert (logger.is_running, len(logger._present._own)) == (True, 2 if does == "set" else 1)


def interrupted_at(count, call, *places):
    """Call it with a Ctrl-C, once, before so many lines in files of these places are run; returns where it came.

    No context manager: in Python 3.13 the frame of one and the traceback that went through it hold one another.
    """
    came, left = [], itertools.count(count, -1)

    def trace(frame, _event, _argument):
        return line if any(place in frame.f_code.co_filename for place in places) else None

    def line(frame, event, _argument):
        if event == "line" and not came and next(left) <= 1:
            came.extend([frame.f_code.co_name, frame.f_code.co_filename, frame.f_lineno])
            raise KeyboardInterrupt
        return line

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        assert came
    finally:
        sys.settrace(before)
    return came


@pytest.mark.sampled
def test_a_cut_that_is_interrupted_anywhere_is_whole_or_never_was(new_logger, runtime_folder, drawn):
    before = sys.getswitchinterval(), gc.isenabled()
    for count in [*drawn(range(1, 400), 40), 1000]:  # a cut runs some 440 lines
        logger = new_logger(f"bot{count}")
        loop = Loop(logger)
        logger.parameter("kp", 1.0)
        loop.turn(2)
        cut = partial(logger.set, "x", divider=2, cut=True)
        came = interrupted_at(count, cut, "/silo/logger/", "/silo/loop/run.py", "/silo/parameters/landing.py")
        loop.turn(4)
        assert (logger.is_running, logger.ticks) == (True, 6), came
        assert len(set(map(id, logger._present.stretches))) == len(logger._present.stretches), came
        # one that is made up comes where none can: where a `with` takes or gives its lock back, or at a `try` within
        made_up = bool(came) and linecache.getline(*came[1:]).lstrip().startswith(("with ", "try:"))
        assert made_up or not logger._life.cutting._is_owned(), came
        made = logger._present.run.segment.schema.elements[1].info.options
        assert logger["x"].options == made or re.search("_changing|state", came[0]), came  # it was put back just then
        logger.close(discard=True)
        assert list(runtime_folder.glob("*.segment")) == [], came
        assert bool(came) == (count < 1000)
        assert (sys.getswitchinterval(), gc.isenabled()) == before, came
        current_run._unhurried.forget()


def test_who_keeps_what_interrupted_the_end_of_a_cut_does_not_keep_the_interpreter_as_it_was_within(
    new_logger, monkeypatch
):
    before, puts_back = (sys.getswitchinterval(), gc.isenabled()), current_run._Unhurried._put_back
    interrupts = iter([KeyboardInterrupt])

    def interrupted(unhurried):
        for interrupt in interrupts:
            raise interrupt
        puts_back(unhurried)

    loop = Loop(new_logger("bot"))
    loop.turn(2)
    monkeypatch.setattr(current_run._Unhurried, "_put_back", interrupted)
    with pytest.raises(KeyboardInterrupt) as kept:
        loop.logger.set("x", divider=2, cut=True)
    assert (sys.getswitchinterval(), gc.isenabled()) == before, kept


def test_of_two_loggers_that_are_cut_at_once_the_last_puts_the_interpreter_back(new_logger, monkeypatch):
    before = sys.getswitchinterval(), gc.isenabled()
    loops = [Loop(new_logger(name)) for name in ("one", "two")]
    for loop in loops:
        loop.turn(2)
    first, second = (loop.logger for loop in loops)
    begun, over, prepare = threading.Event(), threading.Event(), Run.prepare

    def overlapping(run):
        prepare(run)
        if run.segment.schema.logger == "one":
            other.start()
            assert begun.wait(DEADLINE_S)
        else:
            begun.set()
            assert over.wait(DEADLINE_S)

    other = threading.Thread(target=lambda: second.set("x", divider=2, cut=True))
    monkeypatch.setattr(Run, "prepare", overlapping)
    first.set("x", divider=2, cut=True)
    within = sys.getswitchinterval(), gc.isenabled()
    over.set()
    other.join()
    assert within != before, "the other was at it still"
    assert (sys.getswitchinterval(), gc.isenabled()) == before


def test_a_stretch_that_is_not_gone_on_with_leaves_nothing(new_logger, runtime_folder, monkeypatch):
    logger = new_logger()
    Loop(logger).turn(2)
    with while_prepared(monkeypatch, logger.stop), pytest.raises(StateError, match="stopped on request, just when"):
        logger.set("x", divider=2, cut=True)
    assert (len([*runtime_folder.glob("*.segment")]), logger._present._own) == (1, logger._present.stretches)


def test_of_two_who_cut_at_once_the_second_waits_for_the_first(new_logger, tmp_path, monkeypatch):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(2)
    refused = []

    def cut_too():
        with pytest.raises(StateError, match=r"no tick yet, or none since its last cut") as error:
            logger.set("n", size=77, cut=True)
        refused.append(error)

    other = threading.Thread(target=cut_too)

    def begin():
        logger._life.cutting = cutting = Awaited(logger._life.cutting)
        other.start()
        assert cutting.waits.wait(DEADLINE_S)

    with while_prepared(monkeypatch, begin):
        logger.set("x", divider=2, cut=True)
    other.join()
    assert refused, "it came second, and had no tick to cut at"
    loop.turn(2)
    logger.set("n", size=77, cut=True)
    assert (logger["x"].options.divider, logger["n"].options.size, len(logger._present.stretches)) == (2, 77, 3)
    loop.turn(2)
    logger.save()
    loop.whole(tmp_path)


def test_a_logger_that_is_closed_while_a_stretch_is_prepared_leaves_nothing(new_logger, runtime_folder, monkeypatch):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(2)
    closing = threading.Thread(target=lambda: logger.close(discard=True))

    def close():
        logger._life.cutting = cutting = Awaited(logger._life.cutting)
        closing.start()
        assert cutting.waits.wait(DEADLINE_S)

    with while_prepared(monkeypatch, close), pytest.raises(StateError, match=r"is closed|stop"):
        logger.set("x", divider=2, cut=True)
    closing.join()
    assert (list(runtime_folder.glob("*.segment")), logger._present._own) == ([], [])


def full(*_):
    """A disk that has no room."""
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("x", {"divider": 0}, ElementError, "divider"),
        ("nobody", {"divider": 2}, ElementError, "nobody"),
        ("x", {"size": 2000, "buffer": "fixed"}, SegmentError, "no room for"),
        ("x", {"divider": 2}, StateError, "excited"),
    ],
)
def test_a_cut_that_is_refused_changes_nothing(new_logger, monkeypatch, name, options, error, words):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(3)
    if words == "excited":
        monkeypatch.setattr(type(logger.parameters.excitations), "running", True)
    if error is SegmentError:
        monkeypatch.setattr("os.posix_fallocate", full)
    before = held(logger)
    with pytest.raises(error, match=words):
        logger.set(name, **options, cut=True)
    assert held(logger) == before
    loop.turn(2)
    assert logger.snapshot().elements[0].entries[0].values.tolist() == [0, 1, 2, 3, 4]


def test_a_cut_waits_for_a_tick_and_for_files(new_logger):
    logger = new_logger()
    loop = Loop(logger)
    with pytest.raises(StateError, match="no tick yet"):
        logger.set("x", divider=2, cut=True)
    for cut in range(MOST_CUT_OFF):
        loop.turn()
        logger.set("x", divider=2 + cut, cut=True)
    with pytest.raises(StateError, match="no tick yet"):
        logger.set("x", divider=99, cut=True)
    loop.turn()
    with pytest.raises(StateError, match=r"save\(\) first"):
        logger.set("x", divider=99, cut=True)
    logger.save()
    logger.set("x", divider=99, cut=True)


@pytest.mark.parametrize("between", [0, 1])
def test_a_run_that_was_saved_just_before_it_was_cut_is_one_log_with_what_follows(new_logger, tmp_path, between):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(5)
    logger.save()
    loop.turn(between)
    logger.set("x", divider=2, cut=True)
    assert logger._present.unsaved_ticks == between, "what stands in a file that knew of no cut isn't lost"
    loop.turn(4)
    logger.save()
    assert not logger._present.cut_off
    assert sorted(path.stem[-5:] for path in tmp_path.glob("*_part*.silo")) == ["part1", "part2"]
    loop.whole(tmp_path)


def test_too_many_elements_are_refused_with_the_way_out(new_logger):
    logger = new_logger()
    for number in range(MOST_ELEMENTS + 1):
        logger.array(f"a{number}", size=2)
    logger.start()
    logger.collect()
    with pytest.raises(StateError, match=f"{MOST_ELEMENTS + 1} elements.*stop, change, start"):
        logger.set("a0", divider=2, cut=True)


def test_a_script_is_loaded_at_a_cut_with_its_conditions_or_not_at_all(new_logger, tmp_path):
    logger = new_logger()
    loop = Loop(logger)
    (script := tmp_path / "walk.yaml").write_text(
        "log_elements: [{name: /log/x, divider: 3}]\ntriggers: [{name: late, when: n > 300}]\n"
    )
    with pytest.raises(StateError, match="no tick yet"):
        logger.load_script(script, cut=True)
    assert (logger._conditions.now.triggers, logger["x"].options.divider) == ((), 1)
    loop.turn(2)
    with pytest.raises(StateError, match="can't load a script while logger 'test' runs"):
        logger.load_script(script)
    assert logger.load_script(script, cut=True) == []
    assert ([one.name for one in logger._conditions.now.triggers], logger["x"].options.divider) == (["late"], 3)
    assert len(logger._present.stretches) == 2
    assert [one.name for one in logger._present.run.segment.schema.conditions.triggers] == ["late"]
    logger.save_script(script)
    logger.trigger("early", "n > 1")
    loop.turn(3)
    logger.load_script(script, cut=True)  # what is no element needs no other stretch
    assert ([one.name for one in logger._conditions.now.triggers], len(logger._present.stretches)) == (["late"], 2)
    logger.save()
    loop.whole(tmp_path)


@pytest.mark.parametrize("unsaved", ["clear", "save"])
def test_counts_are_of_all_stretches_and_a_start_begins_anew(new_logger, tmp_path, unsaved):
    logger = new_logger()
    loop = Loop(logger)
    for _ in range(3):
        loop.turn(4)
        logger.set("x", enabled=not logger["x"].options.enabled, cut=True)
    loop.turn()
    present = logger._present
    assert (logger.ticks, present.unsaved_ticks, logger.has_unsaved) == (13, 13, True)
    assert (present.ticks_before, present.begun_ns) == (12, present.cut_off[0].segment.schema.started_ns)
    assert segment_holdings(present.run.reader).text.endswith("of 1 tick since the last applied change")
    logger.stop()
    with pytest.raises(
        UnsavedError, match=r"of 1 tick since the last applied change, and 12 ticks before that.*='save'"
    ):
        logger.start(unsaved="refuse")
    logger.start(unsaved=unsaved)
    assert (logger.ticks, logger.has_unsaved, present.cut_off) == (0, False, [])
    assert (present.ticks_before, present.begun_ns) == (0, 0)
    if unsaved == "save":
        loop.whole(tmp_path)
    assert len(list(tmp_path.glob("*_part?.silo"))) == (4 if unsaved == "save" else 0)


@pytest.mark.slow
@pytest.mark.parametrize("served", [False, True])
def test_a_run_that_was_cut_and_had_no_tick_since_is_saved(new_logger, runtime_folder, tmp_path, served):
    logger = new_logger()
    if served:
        logger.serve()
    loop = Loop(logger)
    loop.turn(30)
    logger.set("x", divider=2, cut=True)
    logger.stop()
    assert logger.save()[-1].path.endswith("_part2.silo")
    wait_until(lambda: len([*tmp_path.glob("*_part1.silo")]) == 1)
    loop.whole(tmp_path)


def test_a_tick_that_comes_while_a_save_copies_the_buffers_is_in_no_file_yet(new_logger, tmp_path, monkeypatch):
    loop, copied = Loop(new_logger()), SegmentReader.snapshot
    loop.turn(3)

    def snapshot(reader, *given):
        made = copied(reader, *given)
        loop.turn()
        return made

    with monkeypatch.context() as patched:
        patched.setattr(SegmentReader, "snapshot", snapshot)
        loop.logger.save()
    assert loop.logger.has_unsaved


@pytest.mark.slow
def test_a_stretch_that_is_cut_off_while_the_helper_is_asked_to_save_is_saved_too(
    new_logger, runtime_folder, tmp_path, monkeypatch
):
    logger = new_logger()
    loop, look = Loop(logger), logger._data.look_for_unheld
    with logger.serve():
        loop.turn(5)

        def cut_meanwhile(*given):
            monkeypatch.setattr(logger._data, "look_for_unheld", look)
            logger.set("x", divider=2, cut=True)
            look(*given)

        monkeypatch.setattr(logger._data, "look_for_unheld", cut_meanwhile)
        logger.save()
        loop.turn()
        logger.save()
        loop.whole(tmp_path)


@pytest.mark.parametrize("ticks", [0, 30])
def test_what_comes_between_a_cut_and_the_next_tick_stands_there(new_logger, tmp_path, ticks):
    logger = new_logger()
    gain = logger.parameter("kp", 1.0, min=0, max=100)
    loop = Loop(logger)
    loop.turn(50)
    gain.value = 50.0
    loop.turn(50)
    logger.set("x", divider=2, cut=True)
    logger.mark("after the cut")
    with logger.episode("pick") as episode:
        loop.turn(ticks)
        episode.success = True
    logger.save()
    log = loop.whole(tmp_path)
    assert [event.tick for event in log.recording.events if event.text == "after the cut"] == [99]
    assert [(one.first, one.last) for one in log.episodes] == [(100, 129)] * (ticks > 0)
    assert {at: log.parameters.at((log.time_ns[at] - log.time_ns[0]) * 1e-9)["/log/kp"] for at in (0, 49, 51, 99)} == {
        0: 1.0, 49: 1.0, 51: 50.0, 99: 50.0
    }  # fmt: skip


def asked_for(samples, divider=1):
    return [Edit("/log/x", silo.ElementOptions(buffer=BufferType.LOOPING, size=samples, divider=divider))]


@pytest.mark.parametrize("running", [False, True])
def test_a_client_has_the_buffers_take_half_of_the_free_memory_beside_what_they_have(new_logger, monkeypatch, running):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn()
    if not running:
        logger.stop()
    have = logger._present.memory_bytes()
    assert logger._life.memory_bytes() >= have > 0
    monkeypatch.setattr(logger._life, "memory_bytes", lambda: have)  # one that grows may do so just now
    monkeypatch.setattr("silo.logger.scripted_table.available_memory_bytes", lambda: 100_000)
    most = 1000 + (have + 50_000 - logger._scripted._buffers_take()) // 8
    before = held(logger)
    with pytest.raises(ElementError, match=r"from a client .* at most .* nothing was changed"):
        logger._scripted.apply(asked_for(most + 1), cut=running, who="alice@laptop")
    assert held(logger) == before
    assert logger._scripted.apply(asked_for(most + 1), cut=running) == 1  # the program may
    loop.turn(running)
    assert logger._scripted.apply(asked_for(most), cut=running, who="alice@laptop") == 1


def test_a_client_has_a_cut_add_as_much_as_can_be_waited_for(new_logger, monkeypatch):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn()
    monkeypatch.setattr("silo.logger.scripted_table.MORE_AT_A_CUT_BYTES", 8_000)
    with pytest.raises(ElementError, match=r"at most \(8 kB more while the logger runs\): stop, change, start; noth"):
        logger._scripted.apply(asked_for(2001), cut=True, who="alice@laptop")
    for samples in (2000, 3000):  # one after the other
        assert logger._scripted.apply(asked_for(samples), cut=True, who="alice@laptop") == 1
        loop.turn()
    logger.stop()
    assert logger._scripted.apply(asked_for(5000), who="alice@laptop") == 1


def test_stamps_of_slow_elements_count_among_what_a_client_asks_for(new_logger, monkeypatch):
    logger = new_logger()
    logger.array("x", buffer="looping")
    logger.update()
    monkeypatch.setattr("silo.logger.scripted_table.available_memory_bytes", lambda: 100_000_000)
    assert logger._scripted.apply(asked_for(1_000_000), who="alice@laptop") == 1  # 24 MB
    with pytest.raises(ElementError, match=r"would take 1\d GB, from a client 50 MB at most"):
        logger._scripted.apply(asked_for(1_000_000, 1000), who="alice@laptop")


def test_the_parts_of_a_run_are_one_log_with_the_stamps_of_each(new_logger, tmp_path):
    stamps = itertools.count(0, 1000)
    logger = new_logger(clock=lambda: next(stamps))
    loop = Loop(logger)
    for divider in (3, 1, 1):
        loop.turn(7)
        logger.mark(f"at {loop.ticks}")
        if divider > 1 or loop.ticks > 7:
            logger.set("x", divider=divider + loop.ticks % 2, cut=True)
    loop.turn(7)
    logger.save()
    log = loop.whole(tmp_path)
    x = log["x"]
    assert x.time_ns.tolist() == [1000 * (int(value) + 1) for value in x.values]
    assert log["n"].time_ns.tolist() == [1000 * (tick + 1) for tick in range(loop.ticks)]
    marks = [event for event in log.recording.events if event.kind == "marker"]
    assert [(f"at {event.tick + 1}", event.stamp_ns) for event in marks] == [
        (event.text, 1000 * (event.tick + 1)) for event in marks
    ]
    assert len(marks) == 3
    paths = sorted(tmp_path.glob("*_part*.silo"))
    assert len(silo.open_logs(tmp_path)) == 1
    assert silo.open_log(paths[::-1])["x"].values.tolist() == x.values.tolist()
    assert silo.open_log(paths[1], alone=True)["n"].values[0] == 7
    paths[1].unlink()
    with pytest.warns(silo.LogWarning, match="part 2 of this run, which was cut, is missing"):
        assert len(silo.open_log(paths[0])["n"].values) == loop.ticks - 7
    other = new_logger("other")
    Loop(other).turn()
    plain = other.save().path
    with pytest.raises(ElementError, match="parts of one run"):
        silo.open_log([paths[0], plain])


def test_a_run_whose_elements_were_changed_is_saved_with_the_times_of_each_or_told_why_not(new_logger, tmp_path):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(6)
    logger.set("x", divider=3, cut=True)
    loop.turn(6)
    logger.save("silo")
    whole = loop.whole(tmp_path)
    with pytest.raises(SaveError, match="an element changed by a cut has its own: choose a rate"):
        whole.save(tmp_path / "whole.silo")
    whole.save(tmp_path / "whole.npz")
    again = silo.open_log(tmp_path / "whole.npz")
    assert again.recording.stretch == whole.recording.stretch
    assert again.recording.told_about["cut"].startswith("2 parts of run ")
    assert again["x"].time_ns.tolist() == whole["x"].time_ns.tolist()


@pytest.mark.parametrize("kind", ["silo", "mcap", "npz", "csv"])
def test_files_that_told_in_words_which_stretch_they_are_are_one_log(new_logger, tmp_path, kind):
    logger = new_logger()
    loop = Loop(logger)
    loop.turn(4)
    logger.set("x", divider=3, cut=True)
    loop.turn(4)
    logger.save("silo")
    paths, old = [], tmp_path / "old"
    old.mkdir()
    for path in sorted(tmp_path.glob("*_part*.silo")):
        recording = silo.open_log(path, alone=True).recording
        told = replace(recording, about={**recording.about, "cut": recording.stretch.text}, stretch=None)
        paths.append(old / f"{path.stem}.{kind}")
        silo.Log(told).save(paths[-1])
    for which in (paths[1], paths):
        log = silo.open_log(which)
        assert log["n"].values.tolist() == list(range(8))
        assert log.recording.stretch.parts == 2
        assert log.recording.told_about["cut"] == log.recording.stretch.text
    told = replace(log.recording, about=log.recording.told_about, stretch=None)
    silo.Log(told).save(tmp_path / "whole.npz")
    assert silo.open_log(tmp_path / "whole.npz").recording.stretch == log.recording.stretch


OVERWRITTEN = "looping buffers, which keep what is newest, had overwritten"


@pytest.mark.parametrize(("tick", "there"), [(20, 10), (25, 15), (29, 19), (3, 10), (-1, 9)])
def test_an_event_of_a_part_that_lost_its_oldest_ticks_stands_at_its_own(tick, there):
    def part(number, offset, *events):
        stamps = np.arange(offset - 10, offset, dtype=np.int64) * 1000
        return Recording("arm", stamps, offset, (), events=events, stretch=Stretch("run", number))

    marked = LoggedEvent("marker", "there", 7, tick, 1000 * tick, "arm", "run", 1)
    whole = joined([part(2, 30, marked), part(1, 10)])
    assert [event.tick for event in whole.events] == [there]
    assert whole.warnings == (f"part 2: {OVERWRITTEN} its oldest 20 ticks",)
    assert (whole.lost, whole.overwritten) == (0, 20)
    assert (len(whole.time_ns), whole.offset) == (20, 20)


@pytest.mark.parametrize(
    ("firsts", "told"),
    [
        ([20, 20], f"part 2: {OVERWRITTEN} its oldest 20 ticks"),
        ([20, 9], f"part 2: {OVERWRITTEN} its oldest 5 ticks, of some elements 20 ticks"),
        ([20, 4], f"part 2: {OVERWRITTEN} up to 20 ticks of some elements, its oldest"),
        ([10_506, 4], f"part 2: {OVERWRITTEN} up to 10 506 ticks of some elements, its oldest"),
        ([0, 0], ""),
    ],
)
def test_the_hole_that_looping_buffers_left_between_parts_is_told_where_all_stamps_are_there(firsts, told):
    """In a file whose time stamps grow only its samples tell what is not there any more."""

    def part(number, fast, slow):
        loops = element("x", np.zeros(3), first=fast), element("slow", np.zeros(2), divider=5, first=slow)
        stamps = np.arange(max(firsts) + 30, dtype=np.int64) * 1000
        elements = (*loops, element("once", np.zeros(1), buffer_type=BufferType.GROWING))
        return Recording("arm", stamps, len(stamps), elements, stretch=Stretch("run", number))

    whole = joined([part(1, 7, 5), part(2, *firsts)])
    assert "".join(whole.warnings) == told
    assert whole.overwritten == (max(firsts) if told else 0)
    assert [one.buffer_type.name for one in whole.elements] == ["LOOPING", "LOOPING", "GROWING"]


@pytest.mark.parametrize("order", list(itertools.permutations(range(4))))
def test_parts_of_a_recording_whose_rings_end_at_other_ticks_are_read_whole_in_any_order(order):
    """The second has rows of the slow element alone, the fourth is a copy of half of the third."""

    def part(x, slow):
        first = min([*x, *slow])
        stamps = 10**18 + 10**6 * np.arange(first, max([*x, *slow]) + 1)
        elements = [element("x", np.array(x), first=x[0] - first)] if x else []
        elements += [element("slow", np.array(slow), divider=5, first=slow[0] - first)] if slow else []
        return Recording("arm", stamps, first + len(stamps), elements, stretch=Stretch("run", 1, recorder="arm"))

    parts = [
        part([*range(98)], [*range(0, 100, 5)]),
        part([], [*range(100, 150, 5)]),
        part([*range(98, 200)], [*range(150, 200, 5)]),
        part([*range(98, 150)], [150, 155]),
    ]
    whole = joined([parts[at] for at in order])
    x, slow = whole.elements if whole.elements[0].name == "/log/x" else whole.elements[::-1]
    assert x.entries[0].values.tolist() == list(range(200))
    assert slow.entries[0].values.tolist() == list(range(0, 200, 5))
    assert (whole.time_ns.tolist(), whole.warnings) == ((10**18 + 10**6 * np.arange(200)).tolist(), ())
    assert (slow.stamp_indices.tolist(), slow.own_ns) == (list(range(0, 200, 5)), None)


@pytest.fixture
def windowed(tmp_path):
    """A run of 60 ticks of 10 ms that was cut twice, a sixth of it each time, with what is derived by windows."""
    ticks = itertools.count()
    log = silo.Logger(
        "w", frequency=100, folder=tmp_path, script=tmp_path / "no.yaml", clock=lambda: 10**18 + next(ticks) * 10**7
    )
    n, x = log.array("n", (), "int64", buffer="growing"), log.array("x", buffer="growing")
    log.derive("smooth", "mean(n, 50ms)")
    log.derive("twice", "2 * smooth")
    log.derive("most", "max(n, 50ms) > 30")
    log.derive("plain", "n + 1")
    log.derive("step", "diff(n) + 0 * prev(x)")
    log.derive("both", "max(diff(n), 50ms)")
    log.start()
    for tick in range(60):
        if tick in (10, 20):
            log.set("x", divider=3 - log["x"].options.divider, cut=True)
        n[...] = x[...] = tick
        log.collect()
    log.save()
    log.close()
    return tmp_path


def test_derived_signals_look_back_over_the_cuts_of_a_run(windowed):
    log = silo.open_log(windowed)
    expected = [np.mean(range(max(0, tick - 4), tick + 1)) for tick in range(60)]
    for name, factor in (("smooth", 1), ("twice", 2)):
        assert log[name].values == pytest.approx(np.array(expected) * factor), name
    assert log["most"].values.tolist() == [tick > 30 for tick in range(60)]
    assert log["plain"].values.tolist() == list(range(1, 61))
    np.testing.assert_array_equal(log.eval("mean(n, 50ms)").values, log["smooth"].values)
    for name in ("step", "both"):
        assert np.isnan(log[name].values).nonzero()[0].tolist() == [0]
        assert log[name].values[1:].tolist() == [1] * 59
    assert len(log.eval("n + x")) == 60


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_windows_in_the_file_of_a_stretch_are_nan_where_they_reach_back_into_the_one_before(windowed):
    (path,) = windowed.glob("*_part2.silo")
    log = silo.open_log(path, alone=True)
    assert np.flatnonzero(np.isnan(log["smooth"].values)).tolist() == list(range(5))
    assert log["smooth"].values[5:].tolist() == [tick - 2 for tick in range(15, 20)]
    assert not np.isnan(log["plain"].values).any()


@pytest.fixture
def changing(tmp_path):
    """A run of 60 ticks of 10 ms in which `x` and `number` are off from tick 20 to 40, and `slow` becomes slower."""
    ticks = itertools.count()
    script = tmp_path / "no.yaml"
    log = silo.Logger("cut", frequency=100, folder=tmp_path, script=script, clock=lambda: 10**18 + next(ticks) * 10**7)
    n, x = log.array("n", buffer="growing"), log.array("x", buffer="growing")
    number = log.array("number", (), "int32", buffer="growing", divider=3)
    slow = log.array("slow", buffer="growing", divider=2)
    log.start()
    for tick in range(60):
        if tick in (20, 40):
            edits = [silo.Edit(f"/log/{name}", enabled=tick == 40) for name in ("x", "number")]
            log._scripted.apply([*edits, silo.Edit("/log/slow", divider=5 if tick == 20 else 3)], cut=True)
        n[...] = x[...] = number[...] = slow[...] = tick
        log.collect()
    log.save()
    log.close()
    return tmp_path


def test_what_a_cut_switched_off_for_a_while_holds_no_value_then(changing):
    log = silo.open_log(changing)
    there = [*range(20), *range(40, 60)]
    for text in ("n - x", "prev(n) - x", "diff(x)", "n > x"):
        found = log.eval(text)
        assert set((found.time_ns - log.start_ns) // 10**7) <= set(there), text
    assert log.eval("n - x").values.tolist() == [0.0] * 40
    assert np.flatnonzero(log.eval("diff(x)").values != 1).tolist() == [0, 20], "where it begins anew it is NaN"
    numbered = log.eval("n - number")
    assert ((numbered.time_ns - log.start_ns) // 10**7).tolist() == there, "to the cut, not as far as its divider says"
    assert numbered.values.max() == 2
    assert len(log.eval("n - slow")) == 60, "what becomes slower holds to its next sample"
    again = log.clip(0.1, 0.5).eval("n - x")
    assert len(again) == 21


def test_a_signal_that_a_cut_switched_off_for_a_while_has_no_value_then(changing):
    log = silo.open_log(changing)
    n, x = log["n"], log["x"]
    for made in (n - x, x - n, n.resample(x) - x):
        assert ((made.time_ns - log.start_ns) // 10**7).tolist() == [*range(20), *range(40, 60)]
        assert made.values.tolist() == [0.0] * 40
    assert x.resample([0.1, 0.25, 0.45]).values.tolist() == [10, 45]
    assert x.value([0.1, 0.199, 0.41, 9]).tolist() == [10, 19, 41, 59]
    for time in (0.2, 0.35, [0.1, 0.35]):
        with pytest.raises(
            ElementError, match=r"'/log/x' has no value at 0.\d+ s: it was off, overwritten or not recorded, then"
        ):
            x.value(time)


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_a_file_of_a_whole_run_knows_how_long_its_samples_hold(changing, tmp_path, ending):
    silo.open_log(changing).save(tmp_path / f"whole.{ending}")
    assert len(silo.open_log(tmp_path / f"whole.{ending}").eval("n - x")) == 40


@pytest.mark.parametrize("ending", ["silo", "csv", "mcap", "npz"])
def test_a_run_that_was_cut_has_at_one_rate_the_values_that_held(changing, tmp_path, ending):
    made = silo.open_log(changing).resample(50)
    assert made["slow"].values.tolist() == [
        tick // 2 * 2 if tick < 20 else 20 + (tick - 20) // 5 * 5 if tick < 40 else 40 + (tick - 40) // 3 * 3
        for tick in range(0, 60, 2)
    ]
    assert len(made.eval("slow + 0")) == len(made.clip(0.2, 0.3)["slow"]) * 5 == 30
    assert np.isnan(made["x"].values).tolist() == [20 <= tick < 40 for tick in range(0, 60, 2)]
    assert np.ma.getmaskarray(made["number"].values).tolist() == [20 <= tick < 40 for tick in range(0, 60, 2)]
    assert len(made.eval("number >= 0")) == np.isfinite(made.eval("number + 0").values).sum() == 20
    made.save(tmp_path / f"made.{ending}")
    again = silo.open_log(tmp_path / f"made.{ending}")
    for name in ("slow", "x", "number"):
        np.testing.assert_array_equal(np.asarray(again[name]), np.asarray(made[name]), err_msg=name)


def test_a_value_from_before_missing_ticks_of_a_recording_does_not_hold_behind_them():
    def part(*ticks):
        stamps = 10**18 + 10**6 * np.arange(ticks[0], ticks[1])
        slow = np.arange(-(-ticks[0] // 5) * 5, ticks[1], 5)
        elements = [
            element("x", np.arange(*ticks, dtype=float)),
            element("slow", slow.astype(float), divider=5, first=int(slow[0]) - ticks[0]),
        ]
        return Recording("arm", stamps, ticks[1], elements, stretch=Stretch("run", 1, recorder="arm"))

    for end, begin in ((18, 38), (18, 33)):
        log = silo.Log(joined([part(0, end), part(begin, 60)]))
        assert log.eval("x - slow").values.max() == 4
        fresh = log.eval("diff(x)")
        assert np.isnan(fresh.values).nonzero()[0].tolist() == [0, end]
        for text, first in (("max(x, 4ms)", begin + 4), ("mean(x + slow, 4ms)", -(-begin // 5) * 5 + 4)):
            told = log.eval(text).time_ns // 10**6 - 10**12
            assert told.tolist() == [*range(end), *range(first, 60)], text
        assert np.nanmax(fresh.values) == 1
        made = log.resample(1000)
        for name in ("x", "slow"):
            off = np.isnan(made[name].values).nonzero()[0]
            assert (off[0], off[-1] + 1) == (end, begin if name == "x" else -(-begin // 5) * 5), name
        assert len(made.eval("x > 0")) == 60 - (begin - end)
        with pytest.raises(ElementError, match=r"has no value at 0\.02 s"):
            log["x"].value(0.02)
        assert log["x"].value([0.01, 0.017, 0.038]).tolist() == [10, 17, 38]


def test_a_table_of_some_signals_of_a_run_that_was_cut_has_all_its_ticks(new_logger, tmp_path):
    pytest.importorskip("pandas")
    logger = new_logger(frequency=100)
    loop = Loop(logger)
    loop.turn(10)
    logger.set("x", divider=5, cut=True)
    loop.turn(10)
    logger.save()
    table = silo.open_log(tmp_path).to_pandas("x")
    assert len(table) == 20
    assert table.iloc[:, 0].dropna().tolist() == [*range(11), 15]


def test_a_logger_that_is_closed_lets_nobody_copy_what_goes(new_logger, monkeypatch) -> None:
    loop = Loop(new_logger())
    logger, present = loop.logger, loop.logger._present
    loop.turn(5)
    logger.set("x", divider=2, cut=True)
    loop.turn(5)
    (before,) = present.cut_off
    copied, drop = threading.Event(), present.drop
    monkeypatch.setattr(before.reader, "snapshot", copied.set)
    saving = threading.Thread(target=logger._data._save_alone)

    def drop_meanwhile() -> bool:
        saving.start()
        assert not copied.wait(0.2), "it is copied while it goes"
        return drop()

    with monkeypatch.context() as patch:
        patch.setattr(present, "drop", drop_meanwhile)
        logger.close(discard=True)
    saving.join()
    assert not copied.is_set()


def test_of_what_a_dead_program_logged_before_a_cut_that_is_saved_which_is_in_no_file(monkeypatch):
    closed = []
    found = [
        SimpleNamespace(schema=SimpleNamespace(run=run), is_cut=run != "whole", close=partial(closed.append, run))
        for run in ("in no file", "saved", "whole", "present")
    ]
    monkeypatch.setattr(dead_robot, "list_segments", lambda _: [])
    monkeypatch.setattr(dead_robot, "readers", lambda *_: found)
    options = SimpleNamespace(folder="", storage=Storage.MEMORY, name="bot", id="1f")
    replica = SimpleNamespace(
        now=SimpleNamespace(options=options), run="present", is_saved_of=lambda one: one.schema.run == "saved"
    )
    assert dead_robot._cut_off(replica) == found[:1]
    assert closed == ["saved", "whole", "present"]


def test_what_a_dead_program_logged_and_can_not_be_saved_is_told_with_the_way_out(monkeypatch):
    def fails(*_, **__):
        raise SaveError("the disk is full")

    told = []
    monkeypatch.setattr(dead_robot, "claimed", lambda _: nullcontext())
    monkeypatch.setattr(dead_robot, "save_reader", fails)
    monkeypatch.setattr(dead_robot, "_tell", lambda replica, events, text, files: told.append((text, files)))
    events = SimpleNamespace(
        progress=id, log=SimpleNamespace(of_run=id), publish=lambda kind, text: told.append((text, kind))
    )
    replica = SimpleNamespace(now=SimpleNamespace(robot=SimpleNamespace(folder="", segment="")))
    dead_robot._save(replica, events, SimpleNamespace(path="x.segment", schema=SimpleNamespace(run="1f")), "it died")
    text = "it died, and its log could not be saved: the disk is full; run `silo recover x.segment`"
    assert told == [(text, EventKind.SAVE_FAILED), (text, [])]


def test_of_what_earlier_programs_left_nothing_more_is_begun_once_it_is_to_end(monkeypatch):
    begun, first, goes_on = [], threading.Event(), threading.Event()

    def recover(_, stale):
        begun.append(stale)
        first.set()
        goes_on.wait(DEADLINE_S)

    monkeypatch.setattr(dead_robot, "settle_left", lambda *_: [])
    monkeypatch.setattr(dead_robot, "sweep", lambda _: None)
    monkeypatch.setattr(dead_robot, "left_of", lambda _: ["one", "two"])
    monkeypatch.setattr(dead_robot.OrphanRecovery, "_recover", recover)
    options = SimpleNamespace(folder="", name="bot")
    recovery = dead_robot.OrphanRecovery(SimpleNamespace(now=SimpleNamespace(options=options)), None)
    recovery.start()
    assert first.wait(DEADLINE_S)
    recovery.stop(0)
    goes_on.set()
    recovery.stop(DEADLINE_S)
    assert begun == ["one"]


def test_the_end_of_a_stretch_that_was_cut_is_in_its_journal_until_it_is_in_a_file(new_logger, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    log = new_logger("bot", storage="disk", max_time=0)
    log.array("x", buffer=silo.BufferType.GROWING, size=10)
    log.start()
    replica = SimpleNamespace(
        now=SimpleNamespace(options=log.options, robot=SimpleNamespace(folder=log.options.folder)), durable=("", 0),
        durable_ticks=lambda run: 0, open_reader=lambda: SegmentReader(log._present.path), run="",
    )  # fmt: skip
    journaling = Journaling(replica, SimpleNamespace(publish=lambda *_: None))

    def ticks(count):
        replica.run = log._present.run.id
        for _ in range(count):
            log.collect()

    ticks(3)
    journaling._guarded_step()
    ticks(2)
    log.set("x", size=20, cut=True)
    ticks(1)
    journaling._guarded_step()
    journaling._close()
    held = [JournalReader(path) for path in list_journals(log.options.folder, "bot", log.options.id)]
    assert sorted(one.ticks for one in held) == [1, 5]
