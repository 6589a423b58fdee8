"""`silo files`: what it lists, fetches and deletes of a logger that runs."""

import os
import re
import signal
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner

from silo.cli.codes import EXIT_FAILED, EXIT_USAGE
from silo.cli.group import cli
from silo.client.client import Client
from silo.fleet.exchange import client_name
from silo.rpc.published import EventKind
from tests.ipc.conftest import Heard
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


@pytest.fixture
def saved(bench):
    bench.start(300)
    return [Path(bench.logger.save(("silo", "csv"))[0].path), Path(bench.logger.save("bag", name="walk")[0].path)]


def run(*words: str, text: str | None = None):
    return CliRunner().invoke(cli, ["files", *words], input=text)


def test_the_list_names_files_types_span_and_why(bench, saved):
    begun, free = "2023-11-14 [0-2][0-9]:[0-5][0-9]:20", r"[0-9]+\.[0-9] GB free"
    walk = rf"walk +bag +{begun}  3\.0 s +[0-9.]+ kB  saved by the robot program\n"
    both = rf"{saved[0].stem}  silo, csv  {begun}  3\.0 s +[0-9.]+ kB  saved by the robot program\n{walk}"
    head, folder = " +".join(["NAME", "TYPES", "BEGUN", "SPAN", "SIZE", "WHY\n"]), saved[0].parent
    assert re.fullmatch(f"{head}{both}{folder}: 2 recordings, {free}\n", run("ls", "bot").output)
    assert re.fullmatch(
        f"{head}{walk}{folder}: 1 recording, the newest 1 of 2, {free}\n", run("ls", "bot", "-n1").output
    )
    assert "deleted" in run("rm", "bot", "walk", "1", "--yes").output
    assert not list(folder.glob("*00001*"))
    assert re.fullmatch(f"{folder}: 0 recordings, {free}; `silo save` makes one\n", run("ls", "bot").output)


def test_the_list_is_there_for_machines(bench, saved):
    listed = msgspec.json.decode(run("ls", "bot", "--json").output)
    assert [one["stem"] for one in listed["recordings"]] == ["walk", saved[0].stem]


def test_a_run_is_fetched_by_its_number_with_all_its_files(bench, saved, tmp_path):
    done = run("fetch", "bot", "1", "walk", "-o", str(tmp_path / "here"))
    assert done.exit_code == 0, done.output
    names = {path.name for path in (tmp_path / "here").iterdir()}
    stem = saved[0].stem
    assert names == {f"{stem}.silo", f"{stem}.csv", f"{stem}.csv.json", "walk.rosbag2"}
    assert (tmp_path / "here" / f"{stem}.silo").read_bytes() == saved[0].read_bytes()


def test_deleting_asks_first(bench, saved):
    asked = run("rm", "bot", "walk")  # of nobody: there is no terminal
    assert asked.exit_code == EXIT_USAGE
    label = f"bot.{os.getpid()}"
    told = f"delete walk.rosbag2 on {label} for good? Say --yes to delete without being asked; nothing was deleted"
    assert asked.output.endswith(f"Error: {told}\n")
    assert saved[1].exists()
    assert re.fullmatch(r"deleted walk\.rosbag2 \([0-9.]+ kB\)\n", run("rm", "bot", "walk", "--yes").output)
    assert not saved[1].exists()


def test_a_name_that_means_nothing_is_told(bench, saved):
    for word in ("fetch", "rm"):
        refused = run(word, "bot", "none")
        assert refused.exit_code == EXIT_FAILED
        folder = f"the folder of bot.{os.getpid()}"
        assert refused.output == f"Error: no recording is called 'none' in {folder}: see `silo files ls`\n"


def test_a_fetch_goes_on_where_it_was_when_the_helper_process_died_and_came_again(bench, client, tmp_path):
    bench.start(2000)
    path = Path(bench.logger.save(name="long")[0].path)
    killed: list[int] = []
    shares: list[int] = []

    def progress(done: int, total: int) -> None:
        shares.append(done)
        if not killed and 0 < done < total:
            killed.append(client.status().helper_pid)
            os.kill(killed[0], signal.SIGKILL)
            bench.serving.close()
            bench.serving = bench.logger.serve()

    here = client.fetch("long.silo", tmp_path / "here", progress)
    assert killed
    assert here.read_bytes() == path.read_bytes()
    assert shares == sorted(shares)


def test_why_a_recording_is_there_is_told_whoever_saved_it(robots, tmp_path):
    robot = robots("bot")
    with Client.connect("bot") as client:
        heard = Heard(client)
        wait_until(lambda: client.status().ticks > 10)
        client.wait_saved(client.save(name="by_hand"))
        robot.kill()
        ended = f"the robot program (process {robot.pid}) ended without close(); saved "
        assert heard.wait(EventKind.CRASHED).text.startswith(ended)
        listed = {one.stem: one for one in client.recordings().recordings}
        by_hand = listed.pop("by_hand")
        (died,) = listed.values()
        assert by_hand.why == f"saved by {client_name().split()[0]}"
        assert died.why == "program died"
        assert by_hand.own
        assert died.own
        assert died.span_s > 0
        assert "deleted" in client.delete_recording(died.stem)
