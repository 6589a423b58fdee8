"""The life of a logger: update, start, collect, stop, snapshot, close, the end of its program."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.core.elements import BufferType
from silo.core.runtime import list_segments
from silo.errors import SegmentError, StateError
from tests.stand_ins.ticking import collect, values

ROOT = Path(__file__).resolve().parents[2]


def test_nothing_is_logged_before_start_and_a_stop_or_restart_of_what_is_stopped_succeeds(counting):
    logger = counting()
    logger.stop()
    logger.stop()
    assert not logger.is_running
    collect(logger, 3)
    assert logger.ticks == 0
    logger.restart()
    assert logger.is_running


def test_each_collect_is_one_tick_a_stop_keeps_the_data_and_a_start_or_restart_clears_it(counting):
    logger = counting()
    collect(logger, 3)
    assert logger.ticks == 3
    logger.stop()
    assert values(logger) == [0, 1, 2]
    logger.start()
    logger.collect()
    assert (logger.ticks, values(logger)) == (1, [4])
    logger.restart()
    assert (logger.ticks, logger.is_running) == (0, True)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda log: log.start(), "can't start while logger 'test' runs: stop() it first; nothing was changed"),
        (lambda log: log.remove("x"), "can't remove elements while logger 'test' runs: stop() it first; "
         "nothing was changed"),
        (lambda log: log.update(), "can't update the table while logger 'test' runs: stop() it first; nothing "
         "was changed"),
    ],
)  # fmt: skip
def test_what_would_change_a_running_logger_is_refused(counting, call, words):
    with pytest.raises(StateError) as caught:
        call(counting())
    assert str(caught.value) == words


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
    revision = logger._table.revision
    assert logger.remove("g/b") == 1
    assert logger._table.revision > revision
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


def test_a_closed_logger_still_tells_what_it_did(counting):
    logger = counting()
    collect(logger, 3)
    logger.close()
    assert (logger.ticks, logger["x"].lost, logger.is_running, len(logger.elements)) == (3, 0, False, 1)


@pytest.mark.parametrize(
    "call", [lambda log: log.snapshot(), lambda log: log.save(), lambda log: log.read_new_values("x")]
)
@pytest.mark.parametrize("has_run", [True, False])
def test_the_data_of_a_closed_logger_is_gone(counting, new_logger, has_run, call):
    logger = counting() if has_run else new_logger()
    logger.collect()
    logger.close()
    with pytest.raises(StateError, match="is closed"):
        call(logger)


@pytest.mark.parametrize("call", [lambda log: log.snapshot(), lambda log: log.save()])
def test_there_is_no_data_before_the_first_start(new_logger, call):
    with pytest.raises(
        StateError, match=r"nothing was logged yet; call start\(\)|nothing was logged yet: call start\(\)"
    ):
        call(new_logger())


def test_the_segment_is_deleted_when_the_logger_closes(counting):
    logger = counting()
    assert list_segments() == [Path(logger._present.path)]
    logger.close()
    assert list_segments() == []


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
    assert list_segments() == [Path(logger._present.path)]
    assert "run `silo recover`" in capsys.readouterr().err


def test_a_logger_that_the_program_forgot_keeps_its_unsaved_data(tmp_path, capsys):
    logger = silo.Logger("forgotten", folder=tmp_path, script=tmp_path / "none", max_time=0)
    logger.array("x", buffer=BufferType.GROWING)
    logger.start()
    logger.collect()
    del logger
    gc.collect()
    told = capsys.readouterr().err
    assert "logger 'forgotten' was let go of without save() or close(); " in told
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
        "silo.segment.writer.os.posix_fallocate",
        lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")),
    )
    with pytest.raises(SegmentError, match=r"no room for .* [kM]B of buffers.*No space left on device"):
        logger.start()
    assert list(runtime_folder.iterdir()) == []
    assert not logger.is_running
