"""`silo mark`, `silo events`: of a logger that runs, of a folder without one, of a file."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from silo.cli.main import run
from silo.core.elements import LoggedEvent
from silo.files.event_log import append_events, read_events
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


@pytest.fixture
def bot(bench, client):
    bench.start(7)
    wait_until(lambda: [event for event in client.events() if event.kind == "started"])
    return bench


def test_a_mark_goes_to_the_newest_tick_or_to_the_one_given_where_it_is_there(bot, capsys):
    assert run(["mark", "bot", "x", "--tick", "7"]) == 1
    assert "no tick 7 (ticks: 0 to 6); nothing was marked" in capsys.readouterr().err
    assert run(["mark", "bot", "slipped"]) == 0
    assert run(["mark", "here", "--tick", "2"]) == 0
    assert capsys.readouterr().out == "marked tick 6: slipped\nmarked tick 2: here\n"
    assert run(["events", "bot"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "6  marker: slipped  (" in lines[-2]
    assert "2  marker: here  (" in lines[-1]
    run(["events", "bot", "--json"])  # for machines
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(one["kind"], one["tick"]) for one in told][-2:] == [("marker", 6), ("marker", 2)]
    assert told[-2]["stamp_ns"] == bot.begin_ns + 6 * bot.tick_ns


def test_a_mark_of_a_moment_has_its_time_and_its_tick(bot, client):
    bot.ticks(100)
    mark = client.mark("typed slowly", at_ns=bot.begin_ns + 6 * bot.tick_ns)
    assert mark.tick == 6
    assert mark.time_ns <= time.time_ns() - 100 * bot.tick_ns


def test_a_folder_tells_what_happened_when_nobody_runs_any_more(tmp_path, runtime, capsys):
    append_events(tmp_path, "bot", [LoggedEvent("marker", "old", 2, 5)])
    append_events(tmp_path, "arm", [LoggedEvent("stopped", "asked", 1, 3, who="arm")])
    assert run(["events", str(tmp_path)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.endswith("3  stopped: asked  (arm)")
    assert second.endswith("5  marker: old")


def test_what_came_after_the_clock_was_set_back_stands_behind_what_came_before(tmp_path, runtime, capsys):
    minute_ns = 60 * 10**9
    for number, (minutes, text) in enumerate(((50, "first"), (20, "second"), (60, "fifth")), 1):
        append_events(tmp_path, "bot", [LoggedEvent("marker", text, minutes * minute_ns, 5, number=number)])
    for number, (minutes, text) in enumerate(((10, "before"), (55, "fourth")), 1):
        append_events(tmp_path, "arm", [LoggedEvent("marker", text, minutes * minute_ns, 5, number=number)])
    assert run(["events", str(tmp_path)]) == 0
    told = [line.rpartition(" ")[2] for line in capsys.readouterr().out.splitlines()]
    assert told == ["before", "first", "second", "fourth", "fifth"]


def test_a_folder_without_a_log_says_so(tmp_path, runtime, capsys):
    assert run(["events", str(tmp_path)]) == 1
    assert "there is no event log" in capsys.readouterr().err


def test_followers_see_what_comes(bot, client):
    command = [sys.executable, "-c", "from silo.cli.main import main; main()", "events", "bot", "--follow", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as follower:
        follower.stdout.readline()
        client.mark("later")
        assert json.loads(follower.stdout.readline())["text"] == "later"
        follower.terminate()


def test_a_saved_file_tells_and_info_shows_it(bot, client, capsys):
    client.mark("slipped", 3)
    (file,) = client.wait_saved(client.save(["silo"]))
    assert run(["events", file.path]) == 0
    assert "marker: slipped" in capsys.readouterr().out
    assert run(["info", file.path]) == 0
    assert "0.030000 s  tick 3         marker slipped" in capsys.readouterr().out
    assert len(read_events(bot.logger.options.folder, "bot")) >= 2


def test_a_logger_that_runs_goes_before_a_folder_or_file_that_is_called_like_it(bot, tmp_path, monkeypatch, capsys):
    for at, make in ((tmp_path / "folder", Path.mkdir), (tmp_path / "file", Path.touch)):
        at.mkdir()
        make(at / "bot")
        monkeypatch.chdir(at)
        for command, told in (("events", "started"), ("info", "bot on ")):
            assert run([command, "bot"]) == 0
            assert told in capsys.readouterr().out
