"""`storage="disk"`: what a client was told is durable is there after a power cut, and no journal stays without need.

A power cut is here a kill of robot program and helper, and the loss of the segment in memory. What it does to pages
that were not synced is in `tests/property/test_journal.py`.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import LoggerOptions
from silo.core.runtime import process_start
from silo.errors import LogWarning, SegmentError
from silo.journal.format import SCHEMA_FILE
from silo.journal.reader import JournalReader
from silo.logger.unclosed import LoggerEnd
from silo.recovery.journals import is_written, left_journals
from silo.recovery.runs import left_of
from silo.rpc.published import EventKind
from silo.segment.reader import SegmentReader
from tests.crash.durable_robot import OPTIONS
from tests.ipc.conftest import end_helper
from tests.power_cuts import check
from tests.waiting import freeze

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(__file__).with_name("durable_robot.py")


class Durable:
    """A served robot program with `storage="disk"`."""

    def __init__(self, folder: Path, name: str = "arm") -> None:
        self.folder, self.name = folder, name
        self.process = subprocess.Popen(
            [sys.executable, str(PROGRAM), name, str(folder)],
            stdin=-1,
            stdout=-1,
            stderr=-1,
            text=True,
            env=dict(os.environ, PYTHONPATH=str(ROOT)),
        )
        helper, segment = self.process.stdout.readline().split()
        self.helper_pid, self.segment = int(helper), Path(segment)

    def durable(self) -> int:
        with Client.connect(self.name) as client:
            return client.status().durable_ticks

    def tell(self, wish: str) -> None:
        self.process.stdin.write(f"{wish}\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "done\n"

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def kill_both(self, until) -> None:
        """The helper first, and held: it would save what the robot logged. Nobody starts another."""
        with Client.connect(self.name) as client:
            helper = client.status().helper_pid
        freeze(helper)
        self.kill()
        os.kill(helper, signal.SIGKILL)
        # a killed process holds its locks a moment longer
        until(lambda: not process_start(helper) and not any(map(is_written, journals(self.folder))))

    def cut_power(self, until) -> None:
        self.kill_both(until)
        self.segment.unlink()


@pytest.fixture
def tmp_path(disk_path):
    """What is durable is so on a disk."""
    return disk_path


@pytest.fixture
def robot(runtime, tmp_path, until):
    made = Durable(tmp_path)
    yield made
    made.kill()
    end_helper(made.helper_pid)  # else it stays for whoever asks what became of the robot, and holds our pipes
    made.process.communicate()


def journals(folder: Path) -> list[Path]:
    return sorted(folder.glob(".*.journal"))


def saved(folder: Path):
    (path,) = folder.glob("*.silo")
    with pytest.warns(LogWarning):
        return silo.open_log(path)


def grown(robot: Durable, until, beyond: int = 0) -> int:
    """How far a client is told that it is durable, once that is beyond some tick."""
    return until(lambda: (told := robot.durable()) > beyond and told)


# ------------------------------------------------------------------------------------------------- the power cut


def test_after_a_power_cut_all_that_was_told_as_durable_is_recovered(robot, tmp_path, until, capsys):
    first = grown(robot, until)
    told = grown(robot, until, first + 300)  # more than the looping and fixed buffers hold
    robot.cut_power(until)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    proven = int(re.search(r"durable to tick (\d+); .* in memory alone, which is gone \(it was deleted\)", text)[1])
    assert proven >= told
    log = saved(tmp_path)
    check(log.recording, told, OPTIONS)
    assert log.recording.offset == proven
    assert any(f"durable to tick {proven}" in warning for warning in log.warnings)
    assert journals(tmp_path) == []


@pytest.mark.parametrize("words", [[], ["FOLDER"]])
def test_a_journal_is_found_from_anywhere_after_a_power_cut(words, robot, tmp_path, until, capsys, monkeypatch):
    told = grown(robot, until)
    robot.cut_power(until)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    if words:  # the link to the folder is gone: the user knows it
        monkeypatch.setenv("XDG_STATE_HOME", str(elsewhere))
    assert run(["recover", *(word.replace("FOLDER", str(tmp_path)) for word in words)]) == 0
    check(saved(tmp_path).recording, told, OPTIONS)
    assert "nothing to recover" not in capsys.readouterr().out
    assert run(["recover"]) == 0
    assert capsys.readouterr() == ("nothing to recover\n", "")


def test_a_journal_on_a_disk_that_is_not_mounted_is_told_of(robot, tmp_path, until, capsys, monkeypatch):
    grown(robot, until)
    robot.cut_power(until)
    monkeypatch.chdir("/")
    away = tmp_path.rename(tmp_path.with_name("away"))
    assert run(["recover"]) == 0
    assert f"{tmp_path}: a logger kept a journal there" in capsys.readouterr().err
    away.rename(tmp_path)
    assert run(["recover"]) == 0
    assert len(list(tmp_path.glob("*.silo"))) == 1


def test_another_folder_than_the_one_named_is_left_alone(robot, tmp_path, until, capsys):
    grown(robot, until)
    robot.cut_power(until)
    (tmp_path / "other").mkdir()
    assert run(["recover", str(tmp_path / "other")]) == 0
    assert "nothing to recover" in capsys.readouterr().out
    assert len(journals(tmp_path)) == 1


def test_what_a_power_cut_left_is_listed_and_not_touched(robot, tmp_path, until, capsys):
    grown(robot, until)
    robot.cut_power(until)
    for _ in range(2):
        assert run(["recover", "--list", "--look-in", str(tmp_path)]) == 0
        listed = capsys.readouterr().out
        assert "logger 'arm': " in listed
        assert "its journal was durable to tick" in listed
    assert len(journals(tmp_path)) == 1


def test_ls_tells_of_journals_in_this_folder(robot, tmp_path, until, capsys, monkeypatch):
    grown(robot, until)
    robot.cut_power(until)
    monkeypatch.chdir(tmp_path)
    assert run(["ls"]) != 0  # no logger runs
    assert f"1 journal in {tmp_path} may hold what a power cut took from memory" in capsys.readouterr().err


def test_a_journal_that_is_named_is_recovered_into_the_folder_that_is_asked_for(robot, tmp_path, until):
    told = grown(robot, until)
    robot.cut_power(until)
    (journal,) = journals(tmp_path)
    assert run(["recover", str(journal), "--folder", str(tmp_path / "new"), "-t", "csv"]) == 0
    (file,) = (tmp_path / "new").glob("*.csv")
    check(silo.open_log(file).recording, told, OPTIONS)


def test_four_recoveries_of_a_journal_at_once_save_it_once(robot, tmp_path, until):
    grown(robot, until)
    robot.cut_power(until)
    code = f"import sys; from silo.cli.main import run; sys.exit(run(['recover', '--look-in', {str(tmp_path)!r}]))"
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    recoveries = [
        subprocess.Popen([sys.executable, "-c", code], stdout=-1, stderr=-1, text=True, env=environment)
        for _ in range(4)
    ]
    told = [process.communicate() for process in recoveries]
    assert [process.returncode for process in recoveries] == [0] * 4, told
    assert len(list(tmp_path.glob("*.silo"))) == 1
    assert journals(tmp_path) == []


def test_the_next_start_recovers_the_journal_of_its_predecessor(robot, tmp_path, until):
    told = grown(robot, until)
    robot.cut_power(until)
    next_one = Durable(tmp_path)
    until(lambda: list(tmp_path.glob("*.silo")))
    grown(next_one, until)
    check(saved(tmp_path).recording, told, OPTIONS)
    until(lambda: len(journals(tmp_path)) == 1)  # its own
    next_one.tell("close")
    next_one.kill()
    assert "durable to tick" in next_one.process.communicate()[1]


def test_ticks_that_stood_in_a_file_are_not_saved_again(robot, tmp_path, until, capsys):
    grown(robot, until)
    robot.tell("save")
    (journal,) = journals(tmp_path)
    until(lambda: (reader := JournalReader(journal)).ticks == reader.saved_ticks)
    robot.cut_power(until)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert "ticks were saved before its process ended; its journal was removed" in capsys.readouterr().out
    assert len(list(tmp_path.glob("*.silo"))) == 1
    assert journals(tmp_path) == []


# ------------------------------------------------------------------------------- where the segment is still there


def test_while_the_segment_is_there_it_is_saved_and_the_journal_goes(robot, tmp_path, until):
    grown(robot, until)
    robot.kill_both(until)
    assert left_journals(tmp_path) == []
    with closing(SegmentReader(robot.segment)) as reader:
        ticks = reader.ticks
    assert run(["recover"]) == 0
    (path,) = tmp_path.glob("*.silo")
    assert silo.open_log(path).recording.offset == ticks
    assert journals(tmp_path) == []


def test_after_a_crash_of_the_program_the_helper_saves_the_segment_and_drops_the_journal(robot, tmp_path, until):
    grown(robot, until)
    robot.kill()
    until(lambda: list(tmp_path.glob("*.silo")) and not journals(tmp_path))
    (path,) = tmp_path.glob("*.silo")
    check(silo.open_log(path).recording, 1, OPTIONS)


def test_a_saved_segment_is_swept_with_its_journal(robot, tmp_path, until, monkeypatch):
    grown(robot, until)
    robot.tell("save")
    robot.kill_both(until)
    run(["ls"])
    assert not robot.segment.exists()
    assert journals(tmp_path) == []


def test_a_journal_whose_segment_goes_while_others_are_saved_is_found(robot, tmp_path, until):
    grown(robot, until)
    robot.kill_both(until)
    left = left_of(LoggerOptions(name="arm", folder=str(tmp_path)))
    assert next(left).path == robot.segment
    robot.segment.unlink()  # somebody makes room
    assert [one.path for one in left] == journals(tmp_path)


# --------------------------------------------------------------------------------------------- a living logger


def test_the_journal_of_a_living_logger_is_never_touched(robot, tmp_path, until, capsys):
    grown(robot, until)
    (journal,) = journals(tmp_path)
    assert is_written(journal)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert "nothing to recover" in capsys.readouterr().out
    assert run(["recover", str(journal)]) == EXIT_FAILED
    assert "nothing was changed" in capsys.readouterr().err
    grown(robot, until, robot.durable())
    assert journals(tmp_path) == [journal]


@pytest.mark.parametrize("deleted", [False, True])
def test_a_logger_whose_helper_died_is_alive(robot, tmp_path, until, capsys, deleted):
    grown(robot, until)
    freeze(robot.process.pid)  # starts no other helper
    os.kill(robot.helper_pid, signal.SIGKILL)
    (journal,) = journals(tmp_path)
    until(lambda: not is_written(journal))
    if deleted:
        robot.segment.unlink()
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert journals(tmp_path) == [journal]
    assert not list(tmp_path.glob("*.silo"))
    # it is killed as it stands: one that went on would start a helper process, which holds its pipes for 10 s


def proven(folder: Path) -> int:
    """What the journals of a folder prove at this moment, the one that proves most.

    It is looked again where one came or went while they were read: what proves may have been neither listed nor there.
    """
    while True:
        there = journals(folder)
        found = max(map(ticks_of, there), default=0)
        if journals(folder) == there:
            return found


def ticks_of(journal: Path) -> int:
    try:
        return JournalReader(journal).ticks
    except SegmentError:
        return 0  # being made, or just removed: then the other one proves it


def test_while_one_helper_follows_another_what_was_durable_stays_proven(robot, tmp_path, until):
    told = grown(robot, until)
    first = journals(tmp_path)
    os.kill(robot.helper_pid, signal.SIGKILL)
    looks = 0

    def followed() -> bool:
        nonlocal looks
        looks += 1
        assert proven(tmp_path) >= told
        return journals(tmp_path) not in (first, []) and len(journals(tmp_path)) == 1

    until(followed)
    assert looks > 3
    grown(robot, until, told)
    told = robot.durable()
    robot.cut_power(until)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    check(saved(tmp_path).recording, told, OPTIONS)


@pytest.mark.parametrize("saving", [False, True])
def test_close_leaves_no_journal(robot, tmp_path, until, saving):
    grown(robot, until)
    if saving:
        robot.tell("save")
    robot.tell("close")
    assert journals(tmp_path) == []


def test_close_leaves_no_journal_of_a_helper_that_was_killed(robot, tmp_path, until):
    grown(robot, until)
    os.kill(robot.helper_pid, signal.SIGKILL)
    robot.tell("close")
    assert journals(tmp_path) == []


@pytest.fixture
def durable(runtime, tmp_path):
    """A served logger with `storage="disk"` in this process, and its array."""
    log = silo.Logger("arm", folder=tmp_path, script="/none.yaml", storage="disk")
    x = log.array("x")
    log.serve()
    log.start()
    for tick in range(50):
        x[...] = tick
        log.collect()
    yield log
    log.close()


def test_what_was_logged_before_serving_ended_is_all_durable_until_it_is_saved_or_closed(durable, tmp_path):
    durable._life.serving.close()
    (journal,) = journals(tmp_path)
    (element,) = JournalReader(journal).snapshot().elements
    assert element.entries[0].values.tolist() == list(range(50))
    durable.close()
    assert journals(tmp_path) == []


def test_a_program_that_saves_at_its_end_by_itself_leaves_no_journal(durable, tmp_path):
    durable._life.serving.close()
    durable._end(LoggerEnd.UNCLOSED)
    assert journals(tmp_path) == []
    (path,) = tmp_path.glob("*.silo")
    assert silo.open_log(path)["/log/x"].values.tolist() == list(range(50))


@pytest.mark.parametrize("what", ["the journal", "a file of it", "the folder"])
def test_a_journal_that_somebody_deleted_is_told_and_made_anew_with_all_that_the_buffers_hold(
    durable, tmp_path, until, what
):
    with Client.connect("arm") as client:
        until(lambda: client.status().durable_ticks == 50)
        (journal,) = journals(tmp_path)
        if what == "a file of it":
            next(path for path in journal.iterdir() if path.name != "schema").unlink()
        else:
            shutil.rmtree(journal if what == "the journal" else tmp_path)
        durable.collect()
        told = until(
            lambda: (found := [e.text for e in client.events() if e.kind == EventKind.DURABLE.value])[1:] and found
        )
        assert told[0].startswith("somebody deleted the journal: a power cut now loses all after tick 0; it is tried")
        until(lambda: client.status().durable_ticks == 51)
    (journal,) = until(lambda: [path for path in journals(tmp_path) if is_written(path)])
    (element,) = JournalReader(journal).snapshot().elements
    assert element.entries[0].values.tolist()[:50] == list(range(50))


def test_the_status_tells_durable_ticks_of_the_present_run_only(durable, until, capsys):
    with Client.connect("arm") as client:
        until(lambda: client.status().durable_ticks == 50)
        assert run(["info", "arm"]) == 0
        assert "durable     to tick 50; a power cut now would lose 0 ticks after it" in capsys.readouterr().out
        assert client.restart("discard").durable_ticks == 0


def test_a_restart_leaves_no_journal_of_the_run_before(robot, tmp_path, until):
    grown(robot, until)
    (first,) = journals(tmp_path)
    robot.tell("restart")
    (second,) = until(lambda: (found := journals(tmp_path)) not in ([first], []) and len(found) == 1 and found)
    assert first != second
    told = grown(robot, until)
    with Client.connect("arm") as client:
        robot.segment = next(Path(os.environ["SILO_RUNTIME_DIR"]).glob("*.segment"))
        assert client.status().ticks >= told
    robot.cut_power(until)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    check(saved(tmp_path).recording, told, OPTIONS)


def test_a_journal_survives_a_logger_of_the_same_name_and_pid(robot, tmp_path, until):
    """After a reboot services get the same pids again, and name their segments the same."""
    told = grown(robot, until)
    robot.cut_power(until)
    (journal,) = journals(tmp_path)
    kept = tmp_path / "kept"
    shutil.copytree(journal, kept)
    next_one = Durable(tmp_path)
    grown(next_one, until)
    next_one.tell("close")
    next_one.kill()
    next_one.process.communicate()
    check(JournalReader(kept).snapshot(), told, OPTIONS)
    assert len(list(tmp_path.glob("*.silo"))) == 1


# ----------------------------------------------------------------------------------------- torn, empty, full


def by_recover(folder: Path) -> None:
    assert run(["recover", "--look-in", str(folder)]) == 0


def by_start(folder: Path) -> None:
    log = silo.Logger("other", folder=folder, script="/none.yaml")
    log.array("x")
    log.start()
    log.close()


@pytest.mark.parametrize("sweeping", [by_recover, by_start])
@pytest.mark.parametrize("content", [None, b"", b"half of a description"])
def test_a_journal_that_was_being_made_when_the_power_went_is_swept(runtime, tmp_path, capsys, content, sweeping):
    journal = tmp_path / ".arm.01234567-0123456789abcdef.0.journal"
    journal.mkdir()
    if content is not None:
        (journal / SCHEMA_FILE).write_bytes(content)
    sweeping(tmp_path)
    assert journals(tmp_path) == []
    if sweeping is by_recover:
        assert f"{journal}: a journal in which no tick was durable yet; removed" in capsys.readouterr().err


def test_a_journal_whose_description_is_damaged_is_told_and_stays_with_its_rows(robot, tmp_path, until, capsys):
    grown(robot, until)
    robot.cut_power(until)
    (journal,) = journals(tmp_path)
    data = bytearray((journal / SCHEMA_FILE).read_bytes())
    data[200] ^= 1
    (journal / SCHEMA_FILE).write_bytes(data)
    assert run(["recover", "--look-in", str(tmp_path)]) == EXIT_FAILED
    assert "it stays; to free its room: rm -r" in capsys.readouterr().err
    assert journals(tmp_path) == [journal]


def test_a_full_disk_is_told_once_and_the_journal_goes_on_when_there_is_room(
    runtime, small_disk, until, capfd, helper_waits
):
    helper_waits("silo.helper.journaling", RETRY_S=0.2)
    log = silo.Logger("arm", folder=small_disk, script="/none.yaml", storage="disk", max_time=0)
    x = log.array("x", 100, buffer=silo.BufferType.GROWING, size=10)
    with closing(log):
        log.serve()
        with Client.connect("arm") as client:
            events = []
            client.on_event(events.append)
            log.start()
            x[:] = 1
            log.collect()
            until(lambda: client.status().durable_ticks == 1)
            (small_disk / "ballast").write_bytes(bytes(shutil.disk_usage(small_disk).free - 50_000))
            for tick in range(2, 202):
                x[:] = tick
                log.collect()
            durable = until(lambda: [event for event in events if event.kind is EventKind.DURABLE])
            assert "a power cut now loses all after tick 1; make room in" in durable[0].text
            assert client.status().durable_ticks == 1
            (small_disk / "ballast").unlink()
            until(lambda: client.status().durable_ticks == 201)
            told = until(lambda: (found := [e for e in events if e.kind is EventKind.DURABLE])[1:] and found)
            assert [event.text for event in told[1:]] == ["the journal goes on: durable to tick 201"]
            (journal,) = journals(small_disk)
            (element,) = JournalReader(journal).snapshot().elements
            assert np.array_equal(element.entries[0].values, np.arange(1, 202))
            assert sum(log[name].lost for name in log) == 0
    assert capfd.readouterr().err.count("the journal can't be written") == 1


# -------------------------------------------------------------------------------------------- storage="file"


def test_zeroed_pages_of_a_file_are_told_in_the_saved_file(runtime, tmp_path, capsys):
    """With storage="file" nothing is promised for a power cut; what a page lost is not taken for values in silence."""
    code = f"""
import os, silo
log = silo.Logger("arm", folder={str(tmp_path)!r}, script="/none.yaml", storage="file", max_time=0)
x = log.array("x", 3, size=3000)
log.start()
for tick in range(3000):
    x[:] = tick
    log.collect()
os.kill(os.getpid(), 9)
"""
    subprocess.run([sys.executable, "-c", code], env=dict(os.environ, PYTHONPATH=str(ROOT)), check=False)
    (segment,) = tmp_path.glob(".*.segment")
    with closing(SegmentReader(segment)) as reader:
        ring = reader.schema.rings[reader.schema.elements[0].ring]
    begin, end = ring.offset, ring.offset + 8 * ring.row_words * 3000
    data = bytearray(segment.read_bytes())
    data[end // 4096 * 4096 - 24 * 4096 : end] = bytes(end - end // 4096 * 4096 + 24 * 4096)
    assert begin < end - 25 * 4096
    segment.write_bytes(data)
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert "rows of /log/x are damaged" in capsys.readouterr().out
    log = saved(tmp_path)
    (text,) = [warning for warning in log.warnings if "damaged" in warning]
    wrong = int(text.split()[0])
    values = log["x"].values
    zeroed = int((values[1:] == 0).all(axis=1).sum())
    assert 0 < zeroed <= wrong
