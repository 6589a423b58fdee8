"""The life of a logger: update, start, collect, stop, edit, snapshot, close, and what it refuses."""

import gc
import logging
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.collecting import segment
from silo.errors import ElementError, ScriptError, SegmentError, SourceError, StateError
from silo.model import Action, BufferType, Edit, ElementOptions
from silo.runtime import list_segments
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).resolve().parents[2]


class Robot:
    """A bag of attributes."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


def values(logger, name="/log/x"):
    (element,) = [element for element in logger.snapshot().elements if element.name == name]
    return element.entries[0].values.tolist()


@pytest.fixture
def counting(new_logger):
    """A running logger of one element that counts the ticks: `counting(buffer_size=5)`."""

    def make(logger_options=None, **options):
        logger = new_logger(**(logger_options or {}))
        robot = Robot(x=-1)

        def count():
            robot.x += 1
            return robot.x

        logger.add(count, "x", **options)
        logger.start()
        robot.x = -1
        return logger

    return make


# ------------------------------------------------------------------------------------------------- the life


def test_nothing_is_logged_before_start(counting):
    logger = counting()
    logger.stop()
    collect(logger, 3)
    assert logger.ticks == 0


def test_each_collect_is_one_tick(counting):
    logger = counting()
    collect(logger, 3)
    assert logger.ticks == 3


def test_start_clears_buffers_and_ticks(counting):
    logger = counting()
    collect(logger, 3)
    logger.stop()
    logger.start()
    logger.collect()
    assert (logger.ticks, values(logger)) == (1, [4])


def test_restart_clears_buffers_too(counting):
    logger = counting()
    collect(logger, 3)
    logger.restart()
    assert (logger.ticks, logger.is_running) == (0, True)


def test_restart_of_a_stopped_logger_starts_it(counting):
    logger = counting()
    logger.stop()
    logger.restart()
    assert logger.is_running


def test_stop_keeps_the_data(counting):
    logger = counting()
    collect(logger, 3)
    logger.stop()
    assert values(logger) == [0, 1, 2]


def test_stopping_a_stopped_logger_succeeds(counting):
    logger = counting()
    logger.stop()
    logger.stop()
    assert not logger.is_running


def test_starting_a_running_logger_is_refused(counting):
    with pytest.raises(StateError, match="can't start while logger 'test' runs: stop"):
        counting().start()


def test_start_updates_the_table_the_first_time(new_logger):
    logger = new_logger()
    logger.array("x")
    logger.start()
    assert len(logger.elements) == 1


def test_what_is_added_while_running_waits_for_the_next_update(counting):
    logger = counting()
    logger.add(np.zeros(1), "later")
    assert len(logger.elements) == 1
    logger.stop()
    logger.update()
    assert [info.name for info in logger.elements] == ["/log/x", "/log/later"]


def test_what_is_added_after_an_update_is_logged_from_the_next_start(counting):
    logger = counting()
    logger.stop()
    logger.add(np.zeros(1), "later")
    logger.start()
    logger.collect()
    logger.stop()
    assert [(e.name, e.count) for e in logger.snapshot().elements] == [("/log/x", 1), ("/log/later", 1)]


def test_what_is_added_late_is_set_by_the_script_and_the_others_keep_what_was_set_since(new_logger, tmp_path):
    script = tmp_path / "late.yaml"
    script.write_text(
        "log_elements: [{name: /log/x, enabled: true, divider: 7}, {name: /log/y, enabled: true, divider: 5}]"
    )
    logger = new_logger(script=script)
    logger.array("x")
    logger.update()
    logger.set("x", divider=2)
    logger.array("y")
    logger.start()
    assert [info.options.divider for info in logger.elements] == [2, 5]


def test_what_is_added_late_is_not_set_by_a_script_that_was_not_to_be_read(new_logger, tmp_path):
    script = tmp_path / "late.yaml"
    script.write_text("log_elements: [{name: /log/y, enabled: true, divider: 5}]")
    logger = new_logger(script=script)
    logger.update(read_script=False)
    logger.array("y")
    logger.start()
    assert logger.elements[0].options.divider == 1


def test_an_element_that_is_removed_is_logged_no_more_and_the_others_keep_their_options(new_logger):
    logger = new_logger()
    for name in "abc":
        logger.array(name, group="g")
    logger.update()
    logger.set("g/c", divider=3)
    revision = logger.revision
    assert logger.remove("g/b") == 1
    assert logger.revision > revision
    assert [(info.name, info.options.divider) for info in logger.elements] == [("/log/g/a", 1), ("/log/g/c", 3)]
    logger.start()
    logger.collect()
    assert [e.name for e in logger.snapshot().elements] == ["/log/g/a", "/log/g/c"]


def test_a_namespace_is_removed_with_what_waits_for_the_next_update(new_logger):
    logger = new_logger()
    logger.array("a", group="g")
    logger.array("x")
    logger.update()
    logger.array("b", group="g")
    assert logger.remove("g") == 2
    logger.update()
    assert [info.name for info in logger.elements] == ["/log/x"]


def test_the_name_of_a_removed_element_can_be_given_again(new_logger):
    logger = new_logger()
    logger.array("x", 3)
    logger.update()
    logger.remove("x")
    logger.array("x", 2)
    logger.update()
    assert logger.elements[0].shape == (2,)


def test_what_was_logged_of_a_removed_element_can_still_be_saved(new_logger):
    logger = new_logger()
    logger.array("x")
    logger.start()
    logger.collect()
    logger.stop()
    logger.remove("x")
    assert [e.name for e in logger.snapshot().elements] == ["/log/x"]


def test_removing_while_running_is_refused(counting):
    with pytest.raises(StateError, match="can't remove elements while logger 'test' runs"):
        counting().remove("x")


def test_update_is_refused_while_running(counting):
    with pytest.raises(StateError, match="can't update the table while logger 'test' runs"):
        counting().update()


def test_a_closed_logger_can_not_be_started(new_logger):
    logger = new_logger()
    logger.close()
    with pytest.raises(StateError, match="logger 'test' is closed; make a new one"):
        logger.start()


def test_closing_twice_is_fine(counting):
    logger = counting()
    logger.close()
    logger.close()


def test_a_closed_logger_still_tells_what_it_did(counting):
    logger = counting()
    collect(logger, 3)
    logger.close()
    assert (logger.ticks, logger.lost, logger.is_running, len(logger.elements)) == (3, 0, False, 1)


@pytest.mark.parametrize(
    "call", [lambda log: log.snapshot(), lambda log: log.save(), lambda log: log.read_new_values("x")]
)
def test_the_data_of_a_closed_logger_is_gone(counting, call):
    logger = counting()
    logger.collect()
    logger.close()
    with pytest.raises(StateError, match="is closed"):
        call(logger)


def test_collect_of_a_closed_logger_does_nothing(counting):
    logger = counting()
    kept = logger.collect
    logger.close()
    kept()
    logger.collect()


@pytest.mark.parametrize("call", [lambda log: log.snapshot(), lambda log: log.save()])
def test_there_is_no_data_before_the_first_start(new_logger, call):
    with pytest.raises(
        StateError, match=r"nothing was logged yet; call start\(\)|nothing was logged yet: call start\(\)"
    ):
        call(new_logger())


def test_a_logger_is_a_context_manager_that_closes(new_logger):
    with new_logger() as logger:
        logger.array("x")
        logger.start()
    assert list_segments() == []


def test_the_segment_is_deleted_when_the_logger_closes(counting):
    logger = counting()
    assert list_segments() == [Path(logger.segment_path)]
    logger.close()
    assert list_segments() == []


def test_a_restart_leaves_one_segment(counting):
    logger = counting()
    logger.restart()
    assert list_segments() == [Path(logger.segment_path)]


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_after_an_error_unsaved_data_is_saved(counting, capsys, tmp_path, error):
    logger = counting({"folder": tmp_path})
    with pytest.raises(error), logger:
        logger.collect()
        raise error
    (file,) = tmp_path.glob("*.silo")
    assert list(silo.open_log(file)["/log/x"].values) == list(range(logger.ticks))
    assert str(file) in capsys.readouterr().err
    assert list_segments() == []


def test_unsaved_data_that_can_not_be_saved_is_kept_for_recovery(counting, capsys):
    logger = counting({"folder": "/proc/none"})
    with pytest.raises(ZeroDivisionError), logger:
        logger.collect()
        raise ZeroDivisionError
    assert list_segments() == [Path(logger.segment_path)]
    assert "run `silo recover`" in capsys.readouterr().err


def test_a_logger_that_the_program_forgot_keeps_its_unsaved_data(tmp_path, capsys):
    logger = silo.Logger("forgotten", folder=tmp_path, script=tmp_path / "none", max_time=0)
    logger.array("x", buffer_type=BufferType.GROWING)
    logger.start()
    logger.collect()
    del logger
    gc.collect()
    told = capsys.readouterr().err
    assert "logger 'forgotten' ended without save() or close(); " in told
    assert "keeps 1 sample of 1 element" in told
    assert len(list_segments()) == 1


def test_a_logger_that_the_program_forgot_without_data_leaves_nothing(tmp_path):
    logger = silo.Logger("forgotten", folder=tmp_path, script=tmp_path / "none")
    logger.array("x")
    logger.start()
    del logger
    gc.collect()
    assert list_segments() == []


@pytest.mark.slow
def test_a_program_that_ends_without_close_saves_its_unsaved_data(tmp_path, runtime_folder):
    program = f"""
import silo
log = silo.Logger("left", folder={str(tmp_path)!r}, script="none.yaml")
x = log.array("x")
log.start()
log.collect()
"""
    run = subprocess.run(
        [sys.executable, "-c", program],
        env=dict(os.environ, PYTHONPATH=str(ROOT)),
        capture_output=True,
        text=True,
        check=True,
    )
    (file,) = tmp_path.glob("*.silo")
    assert str(file) in run.stderr
    assert list_segments() == []


def test_a_failed_start_leaves_no_file_behind(new_logger, runtime_folder, monkeypatch):
    logger = new_logger()
    logger.array("x")
    monkeypatch.setattr(
        "silo.collecting.segment.os.posix_fallocate",
        lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")),
    )
    with pytest.raises(SegmentError, match=r"no room for .* MB of buffers.*No space left on device"):
        logger.start()
    assert list(runtime_folder.iterdir()) == []
    assert not logger.is_running


# ------------------------------------------------------------------------------------------- stopping by itself


def test_a_logger_of_fixed_buffers_stops_by_itself_when_all_are_full(counting):
    logger = counting(buffer_type=BufferType.FIXED, buffer_size=4, divider=3)
    collect(logger, 100)
    assert (logger.ticks, values(logger), logger.is_running) == (12, [0, 1, 2, 3], False)


def test_a_logger_with_max_time_stops_by_itself(counting):
    logger = counting({"frequency": 10, "max_time": 2}, buffer_type=BufferType.GROWING)
    collect(logger, 100)
    assert (logger.ticks, logger.is_running) == (20, False)
    assert "stopped by itself: the time buffer is full" in logger.stop_reason


def test_a_logger_of_looping_buffers_never_stops_by_itself(counting):
    logger = counting({"frequency": 10, "max_time": 2}, buffer_size=5)
    collect(logger, 1000)
    assert (logger.ticks, values(logger)) == (1000, [995, 996, 997, 998, 999])


def test_a_logger_that_stopped_by_itself_can_be_edited_and_started(counting):
    logger = counting(buffer_type=BufferType.FIXED, buffer_size=4)
    collect(logger, 10)
    logger.set("x", buffer_size=6)
    logger.start()
    collect(logger, 10)
    assert len(values(logger)) == 6


def test_the_segment_says_why_it_ended(counting):
    logger = counting()
    logger.stop()
    assert logger.present_run.reader.stop_reason == logger.stop_reason == "stopped on request"


# --------------------------------------------------------------------------------------- calls in the wrong place


def test_a_second_thread_in_collect_gets_an_error_and_no_row_is_torn(new_logger):
    logger = new_logger(threads="serialized")
    entered, leave = threading.Event(), threading.Event()

    def slow():
        entered.set()
        leave.wait(DEADLINE_S)
        return 1.0

    leave.set()
    logger.add(slow, "x")
    logger.start()
    leave.clear()
    entered.clear()
    first = threading.Thread(target=logger.collect)
    first.start()
    assert entered.wait(DEADLINE_S)
    with pytest.raises(StateError, match=r"collect\(\) was called by a second thread"):
        logger.collect()
    leave.set()
    first.join()
    logger.collect()
    assert logger.ticks == 2


def test_a_source_that_calls_collect_gets_an_error(new_logger, caplog):
    logger = new_logger()
    logger.add(lambda: logger.collect() or 1.0, "x")
    logger.start()
    logger.collect()
    assert logger.source_failures == {"/log/x": 1}
    assert logger.ticks == 1


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("kind", list(BufferType))
@pytest.mark.parametrize("dividers", [(1, 2), (1, 2, 3, 4, 5, 6, 7)])
def test_a_tick_that_is_interrupted_is_logged_wholly_or_not_at_all(new_logger, monkeypatch, interrupt, kind, dividers):
    logger = new_logger(max_time=0)
    robot = Robot(tick=0, interrupt=False)

    def interrupted():
        if robot.interrupt:
            raise interrupt
        return robot.tick

    monkeypatch.setattr(segment, "CHUNK_BYTES", 8192)  # growing: ten rows per chunk
    x = logger.array("x", 98, np.int64, buffer_type=kind, buffer_size=7)
    for divider in dividers:
        read = interrupted if divider == dividers[-1] else lambda: robot.tick
        logger.add(read, f"y{divider}", divider=divider, buffer_type=kind, buffer_size=7)
    logger.add(np.zeros(1), "growing", buffer_type=BufferType.GROWING, buffer_size=1)
    logger.start()
    tick = 0
    for _ in range(40):
        x[:] = robot.tick = tick
        robot.interrupt = True
        if tick % dividers[-1] == 0:
            with pytest.raises(interrupt):
                logger.collect()
        robot.interrupt = False
        logger.collect()
        tick += 1
    recording = logger.snapshot()
    assert recording.offset == tick
    for element in recording.elements[:-1]:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist()
    assert len(logger.read_new_values("x").values) == len(recording.elements[0].stamp_indices)


def test_a_clock_that_fails_leaves_the_tick_to_the_next_call(new_logger):
    times = iter([0, 10, None, 30])

    def clock():
        now = next(times)
        if now is None:
            raise RuntimeError("no time")
        return now

    logger = new_logger(clock=clock)
    logger.array("x")
    logger.start()
    logger.collect()
    with pytest.raises(RuntimeError, match="no time"):
        logger.collect()
    logger.collect()
    assert logger.snapshot().time_ns.tolist() == [10, 30]


def test_a_kept_collect_goes_on_with_the_next_run(counting):
    logger = counting()
    kept = logger.collect
    kept()
    logger.restart()
    kept()
    kept()
    assert logger.ticks == 2


def test_a_kept_collect_of_a_stopped_logger_does_nothing(counting):
    logger = counting()
    kept = logger.collect
    logger.stop()
    kept()
    assert logger.ticks == 0


def test_collect_kept_before_start_logs_after_it(new_logger):
    logger = new_logger()
    kept = logger.collect
    logger.array("x")
    logger.start()
    kept()
    assert logger.ticks == 1


def test_restarts_from_another_thread_neither_tear_rows_nor_stop_the_loop(new_logger):
    logger = new_logger()
    x = logger.array("x", 40, np.int64, buffer_size=100)
    logger.start()
    done = threading.Event()
    failures = []

    def restart():
        for _ in range(40):
            logger.restart()
        done.set()

    other = threading.Thread(target=restart)
    other.start()
    number = 0
    while not done.is_set():
        number += 1
        x[:] = number
        try:
            logger.collect()
        except StateError as error:
            failures.append(error)
    other.join()
    assert failures == []
    collect(logger, 5)
    for element in logger.snapshot().elements:
        rows = np.stack([entry.values for entry in element.entries])
        assert (rows == rows[0]).all()


@pytest.mark.slow
def test_a_forked_child_does_not_write_into_its_parents_buffers(counting):
    logger = counting()
    kept = logger.collect
    collect(logger, 3)
    child = os.fork()
    if child == 0:
        try:
            kept()
            logger.collect()
            os._exit(0 if not logger.is_running and logger.ticks == 0 else 1)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    logger.collect()
    assert values(logger) == [0, 1, 2, 3]


@pytest.mark.slow
def test_a_forked_child_does_not_delete_its_parents_segment(counting):
    logger = counting()
    child = os.fork()
    if child == 0:
        try:
            logger.close()
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    assert Path(logger.segment_path).exists()


@pytest.mark.slow
def test_a_forked_child_may_have_a_logger_of_its_own(new_logger, counting, tmp_path):
    counting().collect()
    child = os.fork()
    if child == 0:
        try:
            with silo.Logger("child", folder=tmp_path, script=tmp_path / "none") as own:
                own.array("x")
                own.start()
                own.collect()
                os._exit(0 if own.ticks == 1 else 1)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_ctrl_c_anywhere_in_collect_leaves_whole_rows(new_logger):
    logger = new_logger(max_time=0)
    robot = Robot(x=0)
    for divider in (1, 2, 3):
        logger.add(lambda: robot.x, f"x{divider}", divider=divider, buffer_size=100_000)
    logger.start()

    def interrupt(_, frame):
        if "<silo collect>" in (frame.f_code.co_filename, frame.f_back.f_code.co_filename):
            raise KeyboardInterrupt

    def loop():
        while True:
            robot.x = logger.ticks
            logger.collect()

    previous = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.0007, 0.0007)
    try:
        for _ in range(100):
            with pytest.raises(KeyboardInterrupt):
                loop()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    for element in logger.snapshot().elements:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist()


# ------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frequency": 0}, "frequency must be above 0"),
        ({"frequency": float("nan")}, "frequency must be above 0"),
        ({"max_time": -1}, "max_time must be from 0"),
        ({"name": "a/b"}, "logger name 'a/b'"),
        ({"name": ""}, "logger name ''"),
        ({"name": "x" * 41}, "1 to 40 letters"),
        ({"storage": "tape"}, "storage must be 'memory', 'disk' or 'file', got 'tape'"),
        ({"size_tiers": 0}, "size_tiers must be a whole number from 1"),
        ({"frequency": "500"}, "frequency must be above 0 and below 1e\\+06 Hz, got '500'"),
        ({"frequency": True}, "frequency must be above 0"),
        ({"max_time": None}, "max_time must be from 0"),
        ({"name": None}, r"the logger's name must be a text, got None \(NoneType\)"),
        ({"script": None}, "script must be a path, got None"),
        ({"folder": 5}, "folder must be a path, got 5"),
        ({"prefix": 5}, "prefix must be a text, got 5"),
        ({"size_tiers": 2.5}, "size_tiers must be a whole number"),
        ({"memory_limit_mb": 1e30}, "memory_limit_mb must be a whole number"),
        ({"checked": "yes"}, "checked must be True or False, got 'yes'"),
        ({"clock": 5}, "clock must be a function without arguments, got 5"),
        ({"clock": lambda: 1 / 0}, r"clock failed when it was asked for the first time \(ZeroDivisionError"),
        ({"clock": lambda: float("nan")}, "clock must return int nanoseconds or float seconds, got nan"),
        ({"clock": lambda: "noon"}, "clock must return int nanoseconds or float seconds, got 'noon'"),
        ({"clock": lambda: True}, "clock must return"),
    ],
)
def test_options_out_of_range_are_named(new_logger, options, words):
    with pytest.raises(ElementError, match=words):
        new_logger(**options)


def test_paths_are_absolute_from_the_start(new_logger, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    options = new_logger(folder="logs", script="a.yaml").options
    assert (options.folder, options.script) == (str(tmp_path / "logs"), str(tmp_path / "a.yaml"))


def test_an_empty_prefix_leaves_names_bare(new_logger):
    logger = new_logger(prefix="/")
    logger.array("q", group="g")
    logger.update()
    assert logger.elements[0].name == "/g/q"


def test_defaults_are_those_of_the_original(new_logger):
    logger = new_logger(frequency=200)
    logger.array("q")
    logger.update()
    (info,) = logger.elements
    assert (info.name, info.unit) == ("/log/q", "-")
    assert info.options == ElementOptions(True, 1, Action.SAVE, BufferType.LOOPING, 2000)


def test_a_default_buffer_holds_max_time_whatever_the_divider(new_logger):
    logger = new_logger(frequency=100, max_time=10)
    logger.array("q", divider=3)
    logger.update()
    assert logger.elements[0].options.buffer_size == 334


def test_storage_on_disk_keeps_the_segment_in_the_folder_of_the_logs(new_logger, tmp_path):
    logger = new_logger(storage="file")
    logger.array("x")
    logger.start()
    assert list_segments(tmp_path) == [Path(logger.segment_path)]
    assert Path(logger.segment_path).parent == tmp_path


def test_the_segment_is_readable_by_its_user_alone(counting):
    assert Path(counting().segment_path).stat().st_mode & 0o777 == 0o600


# ------------------------------------------------------------------------------------------------------- editing


@pytest.mark.parametrize(
    "call",
    [
        lambda log: log.set("x", divider=2),
        lambda log: log.enable(),
        lambda log: log.disable("x"),
        lambda log: log.apply([]),
        lambda log: log.load_script("none.yaml"),
    ],
)
def test_every_edit_is_refused_while_the_logger_runs(counting, call):
    with pytest.raises(StateError, match=r"stop\(\) it first; nothing was changed"):
        call(counting())


def test_a_disabled_element_is_not_collected(counting):
    logger = counting()
    logger.stop()
    logger.disable("x")
    logger.start()
    logger.collect()
    assert logger.snapshot().elements == []


def test_an_edit_takes_effect_at_the_next_start(counting):
    logger = counting()
    logger.stop()
    logger.set("x", divider=2)
    logger.start()
    collect(logger, 5)
    assert len(values(logger)) == 3


def test_edits_are_one_transaction(counting):
    logger = counting()
    logger.stop()
    good = Edit("/log/x", ElementOptions(divider=2, buffer_size=5))
    with pytest.raises(ElementError, match="element '/log/y': the table has no such element; nothing was changed"):
        logger.apply([good, Edit("/log/y", ElementOptions())])
    assert logger.elements[0].options.divider == 1


def test_an_unknown_option_is_refused_with_those_that_there_are(counting):
    logger = counting()
    logger.stop()
    with pytest.raises(ElementError, match="no setting 'sizes'; did you mean 'size'"):
        logger.set("x", sizes=3)


# -------------------------------------------------------------------------------------------------------- script


def test_update_reads_the_script_if_it_is_there(new_logger, tmp_path):
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - name: /log/x\n    enabled: true\n    divider: 4\n")
    logger = new_logger()
    logger.array("x")
    logger.update()
    assert logger.elements[0].options.divider == 4


def test_update_can_leave_the_script_alone(new_logger, tmp_path):
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - name: /log/x\n    divider: 4\n")
    logger = new_logger()
    logger.array("x")
    logger.update(read_script=False)
    assert logger.elements[0].options.divider == 1


def test_a_script_with_problems_changes_nothing_and_stops_every_start(new_logger, tmp_path):
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - name: /log/x\n    divider: 0\n")
    logger = new_logger()
    logger.array("x")
    for _ in range(2):
        with pytest.raises(ScriptError, match=r"logger\.yaml:3"):
            logger.start()
    assert not logger.is_running


def test_names_that_the_table_lacks_are_returned_and_warned_of(new_logger, tmp_path, caplog):
    script = tmp_path / "other.yaml"
    script.write_text("log_elements:\n  - name: /log/gone\n    enabled: true\n")
    logger = new_logger()
    logger.array("x")
    logger.update()
    assert logger.load_script(script) == ["/log/gone"]
    assert any("/log/gone" in record.getMessage() for record in caplog.records if record.levelno == logging.WARNING)


def test_a_saved_script_is_the_configuration(new_logger, tmp_path):
    logger = new_logger()
    logger.array("x", divider=7, enabled=False)
    logger.update()
    written = logger.save_script(tmp_path / "saved.yaml")
    logger.set("x", divider=1, enabled=True)
    logger.load_script(written)
    assert (logger.elements[0].options.divider, logger.elements[0].options.enabled) == (7, False)


# ----------------------------------------------------------------------------------------------------- new values


def test_new_values_are_those_since_the_last_call(counting):
    logger = counting()
    collect(logger, 3)
    assert logger.read_new_values("x").values.tolist() == [0, 1, 2]
    collect(logger, 2)
    assert logger.read_new_values("x").values.tolist() == [3, 4]


def test_values_that_were_overwritten_before_they_were_read_are_counted(counting):
    logger = counting(buffer_size=5)
    collect(logger, 12)
    new = logger.read_new_values("x")
    assert (new.values.tolist(), new.missed) == ([7, 8, 9, 10, 11], 7)


def test_reading_new_values_takes_nothing_from_the_snapshot(counting):
    logger = counting()
    collect(logger, 3)
    logger.read_new_values("x")
    assert values(logger) == [0, 1, 2]


def test_new_values_begin_anew_with_each_start(counting):
    logger = counting()
    collect(logger, 3)
    logger.read_new_values("x")
    logger.restart()
    collect(logger, 2)
    assert len(logger.read_new_values("x").values) == 2


def test_new_values_have_the_shape_of_the_variable(new_logger):
    logger = new_logger()
    logger.array("m", (2, 3))
    logger.start()
    collect(logger, 4)
    assert logger.read_new_values("m").values.shape == (4, 2, 3)


def test_new_values_of_mixed_types_have_a_field_per_suffix(new_logger):
    logger = new_logger()
    logger.add({"a": np.array([1.5]), "_a": np.array([7])}, "x")
    logger.start()
    logger.collect()
    new = logger.read_new_values("x").values
    assert new.dtype.names == ("a", "_a")
    assert new.tolist() == [(1.5, 7)]


def test_new_values_of_an_element_that_is_only_published_can_be_read(counting):
    logger = counting(action=Action.PUBLISH)
    collect(logger, 2)
    assert logger.read_new_values("x").values.tolist() == [0, 1]


def test_new_values_of_a_disabled_element_are_refused(counting):
    logger = counting(enabled=False)
    with pytest.raises(StateError, match="'/log/x' is not logged in this run: enable it and start again"):
        logger.read_new_values("x")


def test_new_values_of_an_unknown_element_name_the_nearest(counting):
    with pytest.raises(ElementError, match="no element '/log/xx'"):
        counting().read_new_values("/log/xx")


# ----------------------------------------------------------------------------------------------------------- names


@pytest.mark.parametrize("name", ["a\nb", "a\tb", "\x00", "/", "//"])
def test_names_that_would_break_files_are_refused(new_logger, name):
    with pytest.raises(ElementError, match="element name"):
        new_logger(prefix="").add(np.zeros(1), name)


def test_a_name_that_is_taken_is_refused(new_logger):
    logger = new_logger()
    logger.array("q")
    with pytest.raises(ElementError, match="element '/log/q' is there already"):
        logger.array("q")


def test_a_value_of_an_element_may_not_be_named_like_another(new_logger):
    logger = new_logger()
    logger.array("q", 3)
    with pytest.raises(ElementError, match="another element has a value named '/log/q_x' already"):
        logger.array("q_x")


def test_an_array_without_memory_of_fixed_size_is_refused(new_logger):
    with pytest.raises(SourceError, match="for text give a length: dtype='S32'"):
        new_logger().array("text", 3, str)


def test_a_variable_in_silos_memory_begins_with_zeros(new_logger):
    q = new_logger().array("q", (2, 3), "f4")
    assert (q.shape, q.dtype, q.any()) == ((2, 3), np.float32, np.False_)


def test_variables_in_silos_memory_survive_the_logger(new_logger):
    logger = new_logger()
    q = logger.array("q", 3)
    logger.start()
    logger.close()
    del logger
    q[:] = 5
    assert q.sum() == 15


# --------------------------------------------------------------------------------------------------------- saving


def test_saving_while_running_loses_no_tick(counting, tmp_path):
    logger = counting()
    collect(logger, 5)
    (saved,) = logger.save("silo")
    collect(logger, 5)
    assert Path(saved.path).exists()
    assert values(logger) == list(range(10))


def test_what_was_saved_is_no_longer_unsaved(counting):
    logger = counting()
    collect(logger, 5)
    assert logger.has_unsaved
    logger.save()
    assert not logger.has_unsaved
    logger.collect()
    assert logger.has_unsaved


def test_an_unknown_file_type_is_refused_with_those_that_there_are(counting):
    with pytest.raises(ElementError, match="unknown file type 'xls'; there are silo, csv and bag"):
        counting().save("xls")


def test_a_logger_has_no_hook_for_missing_names():
    # with one, Python looks `log.collect` up 8 ns slower in each tick
    assert not hasattr(silo.Logger, "__getattr__")
