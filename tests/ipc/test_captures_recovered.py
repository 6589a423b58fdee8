"""A program and its helper process that are killed together within a capture: there is a file, and it says so."""

import os
import re
from pathlib import Path

import psutil
import pytest

import silo
from silo.cli.main import run
from silo.client.client import Client
from silo.core.conditions import TriggerOptions
from silo.core.elements import FileType
from silo.core.runtime import list_segments
from silo.errors import LogWarning, SaveError
from silo.files.event_log import read_events
from silo.helper.left_logs import recover
from silo.rpc.published import EventKind
from tests.waiting import answered, freeze, wait_until

pytestmark = pytest.mark.slow

FALL = TriggerOptions(
    "fall", "x % 100 == 50", pre_s=0.05, post_s=60.0, mode="single", save=(FileType.SILO, FileType.CSV)
)


def fallen(robots, *triggers: TriggerOptions):
    """Kill a program and its helper process within the post of a capture."""
    robot = robots("bot")
    with Client.connect("bot") as client:
        for one in triggers:
            client._set_trigger(one)
        wait_until(lambda: all(one.fires for one in client.triggers().triggers))
        fired = client.status().ticks
        wait_until(lambda: client.status().ticks > fired)  # something of the post is there
        for pid in (robot.helper_pid, robot.pid):
            os.kill(pid, 9)
    robot.kill()
    return robot


def captures(folder: Path, ending: str = "silo") -> list[Path]:
    return sorted(folder.glob(f"bot_*_fall_1.{ending}"))


def check(path: Path) -> None:
    with pytest.warns(LogWarning, match="the program and its helper process died, [0-9 ]+ ticks before its end"):
        log = silo.open_log(path)
    facts = log.recording.conditions.capture
    (fire,) = facts.fires
    values = log["x"].values
    assert values[fire - facts.first] % 100 == 50
    assert facts.first == fire - 25  # 50 ms at 500 Hz
    assert re.match("the program and its helper process died, [0-9 ]+ ticks before its end", facts.ended)
    assert len(values) > 26


def test_recover_writes_the_capture_beside_the_log(robots, tmp_path, monkeypatch, capsys, runtime) -> None:
    fallen(robots, FALL)
    folder = tmp_path / "logs"
    monkeypatch.chdir(tmp_path)
    assert run(["recover"]) == 0
    told = capsys.readouterr().out
    assert "capture 1 of 'fall', ticks" in told
    assert str(captures(folder)[0]) in told
    check(captures(folder)[0])
    assert len(captures(folder, "csv")) == 1
    texts = [event.text for event in read_events(folder, "bot") if event.kind == EventKind.CAPTURED.value]
    assert len(texts) == 1
    assert not list(runtime.glob("*.judge"))


def test_a_capture_that_could_not_be_written_is_written_by_the_next_recover(robots, tmp_path, capsys, runtime) -> None:
    fallen(robots, FALL)
    (segment,) = list_segments(tmp_path / "logs")
    (taken := tmp_path / "taken").write_text("a file where the folder would be")
    with pytest.raises(SaveError):
        recover(segment, taken)
    found = recover(segment)
    check(captures(tmp_path / "logs")[0])
    assert "capture 1 of 'fall', ticks" in found.text
    assert not list(runtime.glob("*.judge"))
    (whole,) = (path for path in (tmp_path / "logs").glob("*.silo") if "fall" not in path.name)
    assert [one.name for one in silo.open_log(whole).recording.conditions.triggers] == ["fall"]


def test_the_next_start_writes_the_capture_and_no_second_one(robots, tmp_path, capsys) -> None:
    fallen(robots, FALL)
    robots("bot")
    folder = tmp_path / "logs"
    wait_until(lambda: captures(folder) and captures(folder, "csv"))
    check(captures(folder)[0])
    found = wait_until(lambda: [one for one in read_events(folder, "bot") if one.kind == EventKind.CAPTURED.value])
    assert "capture 1 of 'fall'" in found[0].text
    wait_until(lambda: len(list(folder.glob("bot_*.silo"))) == 2)
    assert run(["recover", str(folder)]) == 0
    assert len(captures(folder)) == 1
    capsys.readouterr()


def held(robots, runtime) -> tuple[str, Path]:
    """A run that a program held for its triggers before it and its helper process were killed."""
    robot = robots("bot")
    with Client.connect("bot") as client:
        client._set_trigger(TriggerOptions("fall", "x % 100 == 50", pre_s=0.05, post_s=0.05))
        fired = wait_until(
            lambda: (now := answered(client.triggers)) and any(one.fires for one in now.triggers) and now
        )
        freeze(robot.helper_pid)  # frozen: it judges no more
        wait_until(lambda: len(list_segments()) == 1)
    path = runtime / list_segments()[0].with_suffix(".held").name
    for pid in (robot.pid, robot.helper_pid):
        os.kill(pid, 9)
    robot.kill()
    list_segments()[0].rename(path)  # as the next start of the program would have
    return fired.run, path


@pytest.mark.parametrize("named", [False, True])
def test_a_run_that_was_held_is_judged_by_recover_when_program_and_helper_are_gone(
    robots, tmp_path, runtime, named
) -> None:
    first, path = held(robots, runtime)
    (elsewhere := tmp_path / "elsewhere").mkdir()
    assert run(["recover", str(elsewhere)]) == 0
    assert path.exists()
    assert run(["recover", *([str(tmp_path / "logs")] if named else [])]) == 0
    events = read_events(tmp_path / "logs", "bot", first)
    fires = [event.tick for event in events if event.kind == EventKind.TRIGGERED.value]
    assert fires == sorted(set(fires))
    assert fires
    assert len(fires) == len(list((tmp_path / "logs").glob("bot_*_fall_*.silo")))
    assert [path for path in runtime.iterdir() if path.suffix in (".judge", ".held", ".segment")] == []


def test_a_damaged_state_keeps_no_run_of_a_program_that_is_gone(robots, runtime, capsys) -> None:
    _, path = held(robots, runtime)
    (state,) = runtime.glob("*.judge")
    state.write_bytes(b"silo judge 1\nno more")
    assert run(["recover"]) == 0
    assert "what triggers captured of it is lost" in capsys.readouterr().out
    assert not state.exists()
    assert not path.exists()


def test_a_state_whose_program_and_memory_are_gone_is_told_and_forgotten_by_recover(robots, tmp_path, runtime) -> None:
    robot = fallen(robots, FALL)
    for path in list_segments(tmp_path / "logs"):
        path.unlink()
    wait_until(lambda: not psutil.pid_exists(robot.helper_pid))
    assert run(["recover"]) == 0
    texts = [event.text for event in read_events(tmp_path / "logs", "bot") if event.kind == EventKind.BLIND.value]
    assert any("capture 1 of 'fall'" in text and "is lost" in text for text in texts)
    assert any(text.startswith("triggers and limits are blind for run") for text in texts)
    assert not list(runtime.glob("*.judge"))


@pytest.mark.parametrize("comes", ["recover", "start"])
def test_a_run_that_no_helper_process_saw_is_judged_and_its_start_told(robots, tmp_path, runtime, comes) -> None:
    folder = tmp_path / "logs"
    robot = robots("bot")
    with Client.connect("bot") as client:
        client._set_trigger(TriggerOptions("fall", "x % 100 == 50", pre_s=0.01, post_s=0.01))
        first = client.triggers().run
        client.restart(unsaved="discard")
        wait_until(lambda: client.triggers().run != first and client.triggers().triggers[0].fires)
        second = client.triggers().run
    for pid in (robot.helper_pid, robot.pid):
        os.kill(pid, 9)
    robot.kill()
    # as if it had been started while there was no helper process
    wait_until(lambda: not psutil.pid_exists(robot.helper_pid))
    for path in [*runtime.glob("*.judge"), *folder.glob("*_fall_*"), *folder.glob(".bot.*"), *runtime.glob("*.held")]:
        path.unlink()
    if comes == "recover":
        assert run(["recover", str(folder)]) == 0
    else:
        robots("bot")
    fires = wait_until(lambda: [one for one in read_events(folder, "bot", second) if one.kind == "captured"])
    assert [one.kind for one in read_events(folder, "bot", second)].count("started") == 1
    assert len(fires) == len(list(folder.glob("bot_*_fall_*.silo")))
    wait_until(lambda: not list(runtime.glob("*.held")))
