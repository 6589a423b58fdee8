"""What does nothing says so: ticks while a logger stands still, calls before there is one, ends without a save."""

import errno
import itertools
import threading
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.cli.main import run
from silo.errors import ArgumentError, ElementError, SegmentError
from silo.files.silo import writer
from silo.logger import default
from silo.logger.null import NullLogger
from silo.logger.unclosed import LoggerEnd
from tests.stand_ins.ticking import Robot, collect, warnings_of

# ------------------------------------------------------------------------------------------------ ticks


def test_ticks_before_the_first_start_are_counted_and_told_of_once(new_logger, caplog):
    logger = new_logger()
    collect(logger, 3)
    assert warnings_of(caplog) == ["test: collect() logs nothing before the first start: call start()"]
    assert logger._ignored == 3


def test_so_are_those_after_a_stop_and_after_the_end(new_logger, caplog):
    logger = new_logger()
    logger.start()
    logger.collect()
    kept = logger.collect
    logger.stop()
    collect(logger, 2)
    kept()
    assert warnings_of(caplog) == [
        "test: collect() logs nothing while it stands still (stopped on request): start() begins a new run"
    ]
    assert (logger._ignored, logger.ticks) == (3, 1)
    logger.start()
    caplog.clear()
    assert logger._ignored == 0
    logger.close()
    collect(logger, 2)
    assert warnings_of(caplog) == ["test: collect() logs nothing any more, the logger is closed: make a new one"]


def test_an_element_that_is_added_while_it_runs_is_told_of_once(new_logger, caplog):
    logger = new_logger()
    kept = [logger.array("a")]
    logger.start()
    kept += [logger.array("b"), logger.array("c")]
    (warning,) = warnings_of(caplog)
    assert warning.startswith("/log/b was added while the logger runs: it is logged from the next start on")
    caplog.clear()
    logger.restart()
    assert warnings_of(caplog) == []


def test_a_function_is_called_once_when_it_is_added_and_once_at_a_start(new_logger):
    calls, logger = itertools.count(), new_logger()
    logger.add(lambda: next(calls), "n")
    logger.start()
    logger.collect()
    assert silo.Log(logger.snapshot())["n"].values.tolist() == [2]


# ------------------------------------------------------------------------------------- before silo.init


@pytest.fixture
def nobody(monkeypatch):
    monkeypatch.setattr(default, "_default", NullLogger())
    monkeypatch.setattr(default, "_early", {})
    monkeypatch.setattr(default, "_told", set())


@pytest.mark.usefixtures("nobody")
def test_a_start_and_a_save_before_init_are_told_of_once(caplog):
    silo.add(np.zeros(1), "x")
    for _ in range(2):
        silo.start()
        silo.collect()
    silo.save()
    assert warnings_of(caplog) == [
        "silo.start() did nothing: there is no logger before silo.init(); so did silo.add()",
        "silo.save() did nothing: there is no logger before silo.init(); so did silo.add(), silo.collect() (2 times)",
    ]


# --------------------------------------------------------------------------------------------- the end


def test_the_clean_end_of_with_keeps_what_an_unclean_one_keeps(tmp_path, capsys):
    with silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml") as log:
        x = log.array("x")
        log.start()
        for tick in range(3):
            x[...] = tick
            log.collect()
    (path,) = tmp_path.glob("*.silo")
    assert silo.open_log(path)["x"].values.tolist() == [0, 1, 2]
    assert "silo: logger 'walk' ended without save(); saved 3 samples" in (said := capsys.readouterr().err)
    assert str(path) in said
    assert log._life.closed


def test_a_with_that_saved_all_saves_nothing_more(tmp_path, capsys):
    with silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml") as log:
        log.add(x := np.zeros(1), "x")
        log.start()
        log.collect()
        log.save()
    assert len(list(tmp_path.glob("*.silo"))) == 1
    assert "ended without" not in capsys.readouterr().err
    assert x.tolist() == [0]


@pytest.fixture
def closing(tmp_path):
    def one(ticks):
        log = silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml")
        log.add(np.zeros(1), "x")
        log.start()
        collect(log, ticks)
        return log

    return one


def test_closing_with_unsaved_ticks_says_once_how_many_are_dropped_and_what_keeps_them(closing, tmp_path, capsys):
    log = closing(3)
    log.close()
    log.close()
    said = capsys.readouterr().err
    assert said.count("silo: logger 'walk' was closed without save(): 3 ticks that were not saved are dropped") == 1
    assert "save() before close() keeps it, or the end of a `with silo.Logger(...)`" in said
    assert list(tmp_path.glob("*.silo")) == []


def unsaved(log, folder):
    """Have a save fail."""
    (folder / "file").touch()
    with pytest.raises(silo.SaveError):
        log.save(folder=folder / "file")
    return log


@pytest.mark.parametrize("again", [False, True])
def test_what_a_save_failed_to_write_outlives_closing(closing, tmp_path, capsys, again):
    log = unsaved(closing(3), tmp_path)
    if again:
        log.save()
        collect(log, 2)
    log.close()
    log.close()
    said = capsys.readouterr().err
    assert said.count("silo: logger") == 1
    if again:  # that one stands in a file, and what came later is dropped as ever
        assert "2 ticks that were not saved are dropped" in said
    else:
        assert "dropped" not in said
        assert "silo: logger 'walk' was closed after a save() that failed; saved " in said
    (path,) = tmp_path.glob("*.silo")
    assert len(silo.open_log(path).times) == 3


def test_what_a_save_failed_to_write_is_dropped_where_that_is_said(closing, tmp_path, capsys):
    log = unsaved(closing(3), tmp_path)
    log.close(discard=True)
    log.close()
    assert "silo: logger" not in capsys.readouterr().err
    assert list(tmp_path.glob("*.silo")) == []


def test_closing_that_was_interrupted_in_its_save_may_drop_then(closing, tmp_path, monkeypatch):
    log = unsaved(closing(3), tmp_path)

    def interrupted(*_):
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(writer, "write_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        log.close()
    log.close(discard=True)
    assert list(tmp_path.glob("*.silo")) == []


def test_closing_that_was_interrupted_behind_its_save_saves_no_second_time(closing, tmp_path, monkeypatch):
    log = unsaved(closing(3), tmp_path)

    def interrupted():
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(log._present, "drop", interrupted)
    with pytest.raises(KeyboardInterrupt):
        log.close()
    log.close()
    assert len(list(tmp_path.glob("*.silo"))) == 1


@pytest.mark.parametrize("first", [LoggerEnd.CLOSED, LoggerEnd.UNCLOSED, LoggerEnd.BLOCK])
@pytest.mark.parametrize("second", [LoggerEnd.CLOSED, LoggerEnd.UNCLOSED, LoggerEnd.BLOCK])
def test_two_that_end_a_logger_at_once_write_one_file(closing, tmp_path, monkeypatch, first, second):
    log, real = unsaved(closing(3), tmp_path), writer.write_all
    writing, go_on = threading.Event(), threading.Event()

    def slow(*arguments):
        writing.set()
        go_on.wait(10)
        return real(*arguments)

    monkeypatch.setattr(writer, "write_all", slow)
    ends = [threading.Thread(target=log._end, args=(end,)) for end in (first, second)]
    ends[0].start()
    assert writing.wait(10)
    ends[1].start()
    ends[1].join(0.1)  # were it not to wait for the first one, it would write now
    go_on.set()
    for end in ends:
        end.join(10)
    assert len(list(tmp_path.glob("*.silo"))) == 1


def test_a_signal_handler_that_ends_a_logger_amid_a_start_of_it_lets_another_thread_end_it(
    closing, tmp_path, monkeypatch
):
    log = unsaved(closing(3), tmp_path)
    ends, make_run = threading.Thread(target=log._end, args=(LoggerEnd.UNCLOSED,), daemon=True), log._make_run

    def amid_it():
        ends.start()
        ends.join(0.1)  # until it waits for the lock
        log.close()
        return make_run()

    monkeypatch.setattr(log, "_make_run", amid_it)
    begins = threading.Thread(target=log.restart, kwargs={"unsaved": "save"}, daemon=True)
    begins.start()
    for thread in (begins, ends):
        thread.join(10)
        assert not thread.is_alive()
    assert log._life.closed
    assert len(list(tmp_path.glob("*.silo"))) == 1


@pytest.mark.slow
@pytest.mark.parametrize("second", [LoggerEnd.UNCLOSED, LoggerEnd.CLOSED, None])
def test_what_is_in_no_file_is_saved_though_its_server_is_being_closed(tmp_path, runtime_folder, monkeypatch, second):
    log = silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml")
    log.add(x := np.zeros(1), "x")
    log.start()
    serving, leaving, go_on = log.serve(), threading.Event(), threading.Event()
    for x[0] in range(3):
        log.collect()
    says = serving._say_goodbye

    def slow() -> None:
        leaving.set()
        go_on.wait(10)
        says()

    monkeypatch.setattr(serving, "_say_goodbye", slow)
    first = threading.Thread(target=serving.close)
    ends = threading.Thread(target=log._end if second else serving.close, args=filter(None, [second]))
    first.start()
    assert leaving.wait(30)
    ends.start()
    ends.join(0.1)  # were it not to wait, it would be done now
    assert ends.is_alive()
    go_on.set()
    for thread in (first, ends):
        thread.join(30)
    assert len(list(tmp_path.glob("*.silo"))) == (second is LoggerEnd.UNCLOSED)
    log.close(discard=True)


@pytest.mark.slow
@pytest.mark.parametrize("serves", [False, True])
def test_closing_that_keeps_lets_go_of_memory_and_arrays_as_any(tmp_path, runtime_folder, serves):
    log, x = silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml"), np.zeros(1)
    log.add(x, "x")
    if serves:
        log.serve()
    log.start()
    collect(log, 3)
    unsaved(log, tmp_path)
    log.close()
    log.close()
    x.resize(5)
    (path,) = tmp_path.glob("*.silo")
    assert len(silo.open_log(path).times) == 3
    assert list(runtime_folder.glob("*.segment")) == []


def test_what_nobody_could_write_waits_for_recover_behind_closing(closing, tmp_path, capsys, monkeypatch):
    log = closing(3)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(writer, "write_all", full)
    with pytest.raises(silo.SaveError):
        log.save()
    log.close()
    log.close()
    said = capsys.readouterr().err
    assert "silo recover" in said
    assert "dropped" not in said


@pytest.mark.parametrize(
    ("ticks", "end"),
    [
        (0, lambda log: log.close()),
        (3, lambda log: (log.save(), log.close())),
        (3, lambda log: log.close(discard=True)),
        (3, lambda log: (log.close(discard=True), log.close())),
        (3, lambda log: log._end(LoggerEnd.UNCLOSED)),
        (3, lambda log: log.__exit__(None, None, None)),
    ],
    ids=["nothing collected", "all saved", "discarded", "discarded and closed", "abandoned", "with"],
)
def test_where_nothing_is_dropped_or_all_is_on_purpose_closing_says_nothing_of_it(closing, capsys, ticks, end):
    end(closing(ticks))
    assert "was closed without save()" not in capsys.readouterr().err


def test_what_can_not_be_saved_at_the_end_stays_for_recover(tmp_path, capsys, monkeypatch):
    def refuse(*_, **__):
        raise silo.errors.SaveError("the disk refuses")

    with silo.Logger("walk", folder=tmp_path, script=tmp_path / "none.yaml") as log:
        log.add(np.zeros(1), "x")
        log.start()
        log.collect()
        monkeypatch.setattr("silo.files.write_run", refuse)
    assert "run `silo recover` to save it" in capsys.readouterr().err
    log._present.run.drop()  # which stays as long as its process


@pytest.mark.parametrize(
    ("types", "max_time", "told"),
    [
        (("looping", "fixed", "growing"), 10.0, True),
        (("looping", "growing"), 10.0, True),
        (("growing",), 10.0, True),
        (("fixed", "growing"), 10.0, True),
        (("fixed", "fixed"), 10.0, False),
        (("looping", "looping"), 10.0, False),
        (("looping", "growing"), 0, False),
        (("looping", "growing"), 60, True),
        (("growing", "growing"), 60, False),
    ],
)
def test_a_run_that_ends_by_itself_for_some_of_its_buffers_says_so_at_its_start(
    new_logger, caplog, types, max_time, told
):
    logger = new_logger(max_time=max_time)
    kept = [logger.array(f"x{number}", buffer=kind) for number, kind in enumerate(types)]
    logger.start()
    assert len(kept) == len(types)
    assert [warning.partition(", as not all")[0] for warning in warnings_of(caplog)] == (
        [f"test: logging stops by itself after {max_time:g} s (max_time)"] if told else []
    )


@pytest.mark.parametrize("option", [{"buffer": "growing"}, {"buffer": "fixed", "size": "200s"}], ids=str)
def test_so_does_a_cut_that_has_one_end_by_itself_and_none_after_it(new_logger, caplog, option):
    logger = new_logger()
    kept = [logger.array(name) for name in ("x", "y")]
    logger.start()
    logger.collect()
    logger.set("x", cut=True, **option)
    assert warnings_of(caplog) == [
        "test: logging stops by itself after 10 s (max_time), as not all buffers are looping (/log/x): for a run "
        "without end give max_time=0, or make them looping"
    ]
    logger.collect()
    logger.set("y", cut=True, **option)
    logger.collect()
    logger.set("/", buffer="looping", cut=True)
    assert len(warnings_of(caplog)) == 1
    assert len(kept) == 2


def test_a_start_that_drops_what_is_in_no_file_says_so_once(new_logger, caplog):
    logger = new_logger()
    kept = logger.array("x")
    for _ in range(3):
        logger.restart()
        collect(logger, 2)
    (warning,) = warnings_of(caplog)
    assert kept.shape == ()
    keeps = 'or captured stays): save() before it, or start(unsaved="save"), keeps them (said once)'
    told = "this start dropped {} of the last run that were not saved (what was recorded"
    assert warning == f"test: {told.format('2 ticks')} {keeps}"
    logger.save()
    other = new_logger("other")
    other.array("x")
    other.start()
    collect(other, 1)
    other.save()
    other.restart()
    assert len(warnings_of(caplog)) == 1
    collect(other, 1)
    other.restart(unsaved="save")
    collect(other, 1)
    other.restart()
    _, saved, dropped = warnings_of(caplog)
    assert saved.startswith("other: the last run was saved before it is cleared: ")
    assert dropped == f"other: {told.format('1 tick')} {keeps}"


@pytest.mark.parametrize("kind", ["a file", "a folder below a file", "closed", "there", "yet to be made"])
def test_a_folder_in_which_nothing_can_be_saved_is_told_of_at_the_start(
    new_logger, caplog, tmp_path, kind, monkeypatch
):
    file = tmp_path / "file"
    file.write_text("")
    folder = {"a file": file, "a folder below a file": file / "logs"}.get(kind, tmp_path / "a" / "b")
    if kind == "there":
        folder.mkdir(parents=True)
    if kind == "closed":  # root may write anywhere
        monkeypatch.setattr("silo.logger.arguments.options.os.access", lambda *_: False)
    logger = new_logger(folder=folder)
    kept = logger.array("x")
    logger.start()
    assert kept.shape == ()
    told = {"closed": f"{tmp_path} can't be written to"}.get(kind, f"{file} is no folder")
    says = [f"test: saves to {folder} will fail: {told}; save(folder=...) saves elsewhere"]
    assert warnings_of(caplog) == ([] if kind in ("there", "yet to be made") else says)


# ------------------------------------------------------------------------------------------ wrong turns


@pytest.mark.parametrize("served", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_file_without_samples_is_told_of(new_logger, runtime_folder, caplog, served):
    logger = new_logger()
    if served:
        logger.serve()
    logger.start()
    assert not len(silo.open_log(logger.save().path).time_ns)
    assert "nothing was collected since start(), the file holds no samples" in caplog.text


def test_deleting_an_element_says_how(new_logger):
    logger = new_logger()
    logger.array("q")
    for one in (logger, NullLogger()):
        with pytest.raises(ArgumentError, match=r"log\.remove\('q'\) forgets it"):
            del one["q"]


def test_another_case_is_asked_back(new_logger):
    logger = new_logger()
    logger.array("joints/q")
    logger.update()
    for name in ("Q", "joints/Q", "/log/JOINTS/q"):
        with pytest.raises(ElementError, match="did you mean '/log/joints/q'"):
            logger[name]


# ----------------------------------------------------------------------------------------- NullLogger


def test_a_logger_that_logs_nothing_knows_names_and_shapes():
    null, robot = NullLogger(), Robot(mode=1)
    q = null.array("q", 12, group="joints")
    null.add(robot, attr="mode")
    null.add(lambda: 1.0, "load")
    assert list(null) == ["/log/joints/q", "/log/mode", "/log/load"]
    assert len(null) == 3
    assert "joints/q" in null
    assert "none" not in null
    assert null["joints/q"].shape == q.shape
    assert null.read_new_values("joints/q").values.shape == (0, 12)
    assert null.read_new_values("none").values.shape == (0,)
    assert (null.remove("joints"), list(null)) == (1, ["/log/mode", "/log/load"])


def test_what_it_saves_are_no_files_with_a_path_that_can_be_read():
    saved = NullLogger().save()
    assert (list(saved), Path(saved.path).read_bytes(), saved.size_bytes) == ([], b"", 0)


# ------------------------------------------------------------------------------------- limits of the system


def test_a_limit_on_the_size_of_files_is_named(new_logger, small_files):
    logger = new_logger()
    kept = logger.array("q", 1000)
    told = r"may make files of 1[\d.]+ kB only \(RLIMIT_FSIZE, `ulimit -f`\)"
    with small_files(100_000), pytest.raises(SegmentError, match=told):
        logger.start()
    logger.start()
    assert kept.shape == (1000,)


def test_a_working_directory_that_was_deleted_is_named(tmp_path, monkeypatch, capsys):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(ElementError, match=r"script 'arm\.logger\.yaml' can't be found: the working directory"):
        silo.Logger("arm")
    silo.Logger("arm", folder=tmp_path, script=tmp_path / "none.yaml").close()
    assert run(["ls"]) == 1
    assert capsys.readouterr().err.startswith("silo: the working directory of this process was deleted")


@pytest.mark.parametrize("look", [lambda: silo.open_log("x"), lambda: silo.open_log("."), lambda: silo.open_logs(".")])
def test_a_log_of_a_working_directory_that_was_deleted_is_not_found_in_words(tmp_path, monkeypatch, look) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(silo.SiloError, match="the working directory of this process was deleted"):
        look()


def test_what_some_of_several_formats_have_is_saved(new_logger, tmp_path, capsys):
    log = new_logger()
    log.array("x")
    log.start()
    log.collect()
    (tmp_path / "x.csv.json").mkdir()
    with pytest.raises(silo.SaveError, match=r"x\.csv.*; saved: .*x\.silo"):
        log.save(["silo", "csv"], name="x", folder=tmp_path)
    assert not log.has_unsaved
    log.collect()
    assert log.has_unsaved
    (tmp_path / "y.silo").mkdir()
    with pytest.raises(silo.SaveError):
        log.save(name="y", folder=tmp_path)
    assert log.has_unsaved
    log.save()
    log.close()
    assert "was closed without save()" not in capsys.readouterr().err
