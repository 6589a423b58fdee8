"""Endless recordings of a served logger: begun by clients and by the program, kept on through kills of all sorts."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

import silo
from silo.cli.codes import EXIT_USAGE
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import BufferType, RecorderState
from silo.errors import ConnectionLostError, ElementError, RefusedError, SaveError, StateError
from silo.files.event_log import read_events
from silo.files.manifest import read_written
from silo.recorder.requests import recording_folder
from silo.recovery.parts import left_parts
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, answered
from silo.verify.folder import verify
from tests.ipc.conftest import Heard
from tests.waiting import wait_until
from tests.whole_bags import read_bag

RESTING = 50  # ticks of the robot program in which x is 0


def parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2])


def span(path: Path) -> tuple[int, int]:
    """The ticks of a part of the robot program, after a look at every value, and at what others read of it."""
    found = read_bag(path)
    first = found.offset - len(found.time_ns)
    for element in found.elements:
        assert element.lost == 0
        ticks = first + element.stamp_indices
        for entry in element.entries:
            assert (entry.values == np.maximum(ticks - RESTING + 1, 0)).all()
    with path.open("rb") as file:
        count = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    with Reader(path) as reader:
        there = sum(element.count for element in found.elements) + len(found.events)
        assert sum(1 for _ in reader.messages()) == count == there
    return first, found.offset


def check_unbroken(paths: list[Path]) -> None:
    spans = [span(path) for path in paths]
    assert [one[1] for one in spans[:-1]] == [one[0] for one in spans[1:]]


def happened(paths: list[Path]) -> list[str]:
    """What happened beside the news of recorders, part by part."""
    return [event.text for path in paths for event in read_bag(path).events if event.kind != EventKind.RECORDING]


def samples(client: Client, more_than: int = 0) -> int:
    info = client.recorders()[0]
    return info.samples if info.state is RecorderState.RECORDING and info.samples > more_than else 0


def another_helper(client: Client, than: int) -> int:
    """The helper process that came after one, 0 as long as there is none."""
    try:
        found = client.status().helper_pid
    except ConnectionLostError:
        return 0
    return found if found != than else 0


@pytest.mark.slow
def test_a_killed_recorder_is_started_again_and_not_a_row_is_missing(robots, tmp_path) -> None:
    robots("bot")
    with Client.connect("bot") as client:
        started = client.record(["x", "/log/q"], to="walks", split="1h")
        before = wait_until(lambda: samples(client))
        client.mark("one")
        os.kill(client.recorders()[0].pid, 9)
        client.mark("two")
        wait_until(lambda: samples(client, before))
        client.mark("three")
        assert client.status().recorders == 1
        heard = Heard(client)
        assert f"ended, in {started.folder}: 2 files" in client.stop_recorder()
        ended = wait_until(lambda: next((one for one in heard.events if "' ended: " in one.text), None))
        assert ended.status.recorders == 0  # not once the next status is asked for
        assert client.recorders() == []
    assert Path(started.folder) == tmp_path / "logs" / "walks"
    assert len(parts(Path(started.folder))) == 2
    check_unbroken(parts(Path(started.folder)))
    assert happened(parts(Path(started.folder))) == ["one", "two", "three"]


@pytest.mark.slow
def test_of_a_killed_helper_the_next_one_goes_on_recording(robots, tmp_path) -> None:
    robot = robots("bot")
    with Client.connect("bot") as client:
        client.record(to="walks", name="walk")
        wait_until(lambda: samples(client))
        client.mark("one")  # answered after half a second also where a starved thread has yet to write it
        wait_until(lambda: "one" in [event.text for event in read_events(tmp_path / "logs", "bot")])
        os.kill(robot.helper_pid, 9)
        robot.helper_pid = wait_until(lambda: another_helper(client, robot.helper_pid))
        wait_until(lambda: samples(client))
        client.mark("two")
        client.stop_recorder("walk")
    found = parts(tmp_path / "logs" / "walks")
    assert len(found) == 2
    check_unbroken(found)
    died = "helper process died (exit code -9), and another one was started; logging went on"
    assert happened(found) == ["one", died, "two"]


@pytest.mark.slow
def test_of_a_killed_robot_program_everything_is_recorded(robots, tmp_path) -> None:
    robot = robots("bot")
    with Client.connect("bot") as client:
        client.record(to="walks")
        wait_until(lambda: samples(client))
        robot.kill()
    (path,) = wait_until(lambda: parts(tmp_path / "logs" / "walks"))
    (log,) = wait_until(lambda: list((tmp_path / "logs").glob("*.silo")))
    from silo.analysis.opening import open_log

    assert span(path)[1] == wait_until(lambda: open_log(log).recording.offset)
    text, *more = happened([path])
    assert text == f"the robot program (process {robot.pid}) ended without close()"
    assert all(one.startswith("saved ") for one in more)  # told while the part is ended: it may still come into it


@pytest.mark.slow
def test_after_a_kill_of_all_recover_closes_the_part(robots, tmp_path, monkeypatch, capsys) -> None:
    robot = robots("bot")
    with Client.connect("bot") as client:
        client.record(to="walks")
        wait_until(lambda: samples(client))
        for pid in (client.recorders()[0].pid, robot.helper_pid, robot.pid):
            os.kill(pid, 9)
    robot.kill()
    monkeypatch.chdir(tmp_path)
    wait_until(lambda: left_parts(tmp_path / "logs" / "walks"))
    assert run(["recover", "--list"]) == 0
    assert "of a recording, left open by a kill" in capsys.readouterr().out
    assert run(["recover"]) == 0
    assert "closed, as its recorder was killed" in capsys.readouterr().out
    span(parts(tmp_path / "logs" / "walks")[0])


def limited(folder: Path, name: str, run: str) -> bool:
    """Whether a recorder writes what comes of a run with limits."""
    written = read_written(folder, name)
    entry = written.entry(run) if written is not None else None
    return entry is not None and entry.conditions is not None and bool(entry.conditions.limits)


@pytest.mark.slow
def test_a_restart_is_recorded_from_its_first_tick_and_the_program_may_record_too(bench, client, heard) -> None:
    bench.logger.set(buffer="looping", size=1000)
    bench.logger.start()
    folder = Path(bench.logger.options.folder)
    assert bench.logger.record(["x"], to=folder.parent / "elsewhere", split="10min") == "bot"
    assert client.record(["x"], keep="50MB").name == "bot-2"
    bench.ticks(100)
    bench.logger.mark("fell")
    bench.logger.restart()
    client.limit("x", (None, None, 1, 120))  # a recorder that looks for rows just now takes it in behind them
    for place, name in ((folder.parent / "elsewhere", "bot"), (folder / "recordings", "bot-2")):
        wait_until(
            lambda of=(place, name): limited(*of, bench.logger._present.run.id)
        )  # it may be reading rows already
    bench.ticks(50)
    wait_until(lambda: client.triggers().tick >= bench.logger.ticks)  # later news is of what follows
    assert client.status().recorders == 2
    with pytest.raises(RefusedError, match="say which recording: there are 'bot', 'bot-2'; nothing was stopped"):
        client.stop_recorder()
    assert "2 files" in bench.logger.stop_recording("bot")
    client.stop_recorder("bot-2")
    assert "of earlier recordings 'bot-2' count into the 50 MB" in client.record(name="bot-2", keep="50MB").text
    assert client.record(name="new", keep="50MB").text == ""
    client.stop_recorder("bot-2")
    client.stop_recorder("new")
    for place in (folder.parent / "elsewhere", folder / "recordings"):
        found = [read_bag(path).elements[0].entries[0].values.tolist() for path in parts(place)]
        assert found == [[float(k) for k in range(1, 101)], [float(k) for k in range(101, 151)]]
        assert "fell" in happened(parts(place)[:1])
        assert "started" in happened(parts(place)[1:])
        assert run(["check", str(parts(place)[-1])]) == 4
    assert "recording 'bot'" in heard.wait(EventKind.RECORDING).text


@pytest.mark.slow
def test_what_was_added_just_now_is_recorded(bench, client) -> None:
    for number in range(5):
        bench.logger.array(f"added{number}")
        bench.logger.update()
        bench.logger.derive(f"made{number}", f"2 * added{number}")
        name = bench.logger.record([f"added{number}", f"made{number}"], name=f"r{number}")
        assert name in {one.name for one in client.recorders()}
        bench.logger.stop_recording(name)


@pytest.mark.slow
def test_a_recording_that_is_begun_before_the_start_has_the_first_tick(bench, client, tmp_path) -> None:
    bench.logger.record()
    bench.logger.start()
    bench.ticks(50)  # at once, whenever the recorder comes to it
    wait_until(lambda: samples(client))
    bench.logger.stop_recording()
    (path,) = parts(tmp_path / "logs" / "recordings")
    found = read_bag(path)
    assert (found.offset - len(found.time_ns), found.offset) == (0, 50)


def test_what_can_not_be_recorded_is_refused_in_words(bench, client, tmp_path) -> None:
    (Path(bench.logger.options.folder)).mkdir(exist_ok=True)
    (Path(bench.logger.options.folder) / "out").symlink_to(tmp_path)
    own = re.escape(f"{bench.logger.options.folder} or folders below it; nothing is recorded")
    wrong = {
        f"^../elsewhere: is outside of the logger's folder; recordings go to {own}$": {"to": "../elsewhere"},
        "leads out of the logger's folder by a link": {"to": "out/walks"},
        "outside of the logger's folder; recordings go to": {"to": "/tmp"},
        "no element matches 'nothing'": {"patterns": ["nothing"]},
        "can't be the name of a log": {"name": "a/b"},
    }
    for words, options in wrong.items():
        with pytest.raises(RefusedError, match=words):
            client.record(**options)
    with pytest.raises(RefusedError, match="nothing is being recorded"):
        client.stop_recorder()
    bench.logger.set("kept", buffer="fixed")
    wait_until(lambda: any(info.options.buffer is BufferType.FIXED for info in client.table().elements))
    with pytest.raises(ElementError, match="write split="):
        client.record(split="often")
    with pytest.raises(SaveError, match="nothing is being recorded"):
        bench.logger.stop_recording()
    assert client.record(name="short").text == (
        "1 element is recorded only until its buffer is full (/log/kept), or, where it grows, until there is no "
        "memory; buffer=looping or action=both has them recorded without end; the logger stops by itself 10 s after "
        "each start (max_time), and nothing is recorded then, as not all buffers are looping (/log/kept): make them, "
        "or give max_time=0 in its program"
    )
    with pytest.raises(RefusedError, match="a recording 'short' is under way already"):
        client.record(name="short")
    assert client.recorders()[0].state is RecorderState.WAITING
    client.stop_recorder()


def test_a_recording_that_waits_for_a_logger_that_max_time_ended_says_so(bench, client) -> None:
    log = bench.logger
    log.set("kept", buffer="growing")
    client.record(name="long")
    log.start()
    while log.is_running:
        log.collect()
    told = ("the logger stands still: stopped by itself: the time buffer is full", "(/log/kept); max_time=0 has no end")
    # it may wait before its process is there, records what is held then, and waits again
    wait_until(lambda: all(each in client.recorders()[0].text for each in told))
    client.stop_recorder()


def test_without_a_helper_process_recording_says_what_it_needs(new_logger) -> None:
    log = new_logger()
    with pytest.raises(StateError, match=r"needs a helper process, which records: call serve\(\) first"):
        log.record()


def test_clients_record_below_the_loggers_folder_and_the_program_where_it_likes(tmp_path) -> None:
    assert recording_folder("", tmp_path, anywhere=False) == tmp_path.resolve() / "recordings"
    assert recording_folder("/data/x", tmp_path, anywhere=True) == Path("/data/x")
    for asked in ("/data/x", "..", "a/../../b", "/"):
        refused = answered(lambda asked=asked: recording_folder(asked, tmp_path, anywhere=False))
        assert isinstance(refused, Refused)
        assert refused.why is RefusedWhy.FORBIDDEN
    (tmp_path / "file").touch()
    (tmp_path / "circle").symlink_to("circle")
    for asked in ("file", "a\nb", "circle", "circle/a", "ö" * 200):
        with pytest.raises(RequestRefusedError):
            recording_folder(asked, tmp_path, anywhere=False)


@pytest.mark.parametrize(("word", "option"), [("ls", "--ls"), ("stop", "--stop [NAME]")])
def test_a_verb_of_other_commands_begins_no_recording_of_nothing(bench, client, capsys, word, option) -> None:
    assert run(["record", word]) == EXIT_USAGE
    assert f"write `silo record {option}`; nothing is recorded" in capsys.readouterr().err
    assert client.recorders() == []


@pytest.mark.slow
def test_the_shell_begins_lists_and_ends_recordings(robots, tmp_path, capsys) -> None:
    robots("bot")
    assert run(["record", "bot", "q", "--to", "walks", "--split", "10min", "--keep", "50GB"]) == 0
    assert "recording 'bot' to" in capsys.readouterr().out
    assert run(["ls"]) == 0
    assert "REC" in capsys.readouterr().out
    assert run(["record", "--ls"]) == 0
    assert "recording" in capsys.readouterr().out
    assert run(["record", "bot", "--stop", "other"]) == 1
    assert "no recording is called 'other'" in capsys.readouterr().err
    assert run(["record", "bot", "--stop"]) == 0
    assert "recording 'bot' ended" in capsys.readouterr().out


def test_a_signal_that_is_derived_while_it_is_recorded_is_missed_nowhere_before(bench, client):
    folder = Path(bench.logger.options.folder)
    client.record(name="walk")
    client.start()
    bench.ticks(100)
    wait_until(lambda: client.recorders()[0].samples >= 100)
    client.derive("late", "x * 2")
    wait_until(lambda: bench.ticks(5) or client.recorders()[0].parts)
    bench.logger.close()
    wait_until(lambda: len([*folder.rglob("*.mcap")]) == 2)
    assert [one.text for one in verify(folder).problems] == []
    parts = [silo.open_log(path) for path in sorted(folder.rglob("*.mcap"))]
    assert ["/log/late" in list(part) for part in parts] == [False, True]
