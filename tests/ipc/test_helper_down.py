"""Loggers whose helper process is down, or dead beside a living namesake; views that can't be fed."""

import os
import resource
import signal
import subprocess
import threading
import weakref
from pathlib import Path

import pytest
from msgspec.structs import replace

import silo
from silo.cli.codes import EXIT_NO_LOGGER
from silo.cli.main import run
from silo.client import connection
from silo.client.client import Client
from silo.client.connection import Connection
from silo.core.elements import State
from silo.core.runtime import down_mark, down_marks, process_start, sweep_unfinished
from silo.errors import ConnectionLostError
from silo.files.event_log import read_events
from silo.fleet.exchange import NoAnswerError
from silo.fleet.resolving import Discovery, LoggerAddress, discover
from silo.history.requests import OpenStream, StreamOpened
from silo.live.requests import OpenView, ViewOpened
from silo.live.streams import ServedStream
from silo.live.views import ServedView
from silo.logger.serving import process, serving
from silo.logger.serving.process import DownMark
from silo.net.keys import ClientId, Root
from silo.net.session import close, open_client
from silo.rpc.declaring import Do
from silo.rpc.refusals import Refused, answered
from tests.fuzz.test_wire import Bench as Parts
from tests.ipc.conftest import no_process
from tests.waiting import DEADLINE_S, freeze, wait_until


@pytest.fixture
def down(bench, monkeypatch):
    """A logger whose helper process was killed, and that can't start another."""
    monkeypatch.setattr(serving, "HelperProcess", no_process)
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    wait_until(lambda: discover().down)
    return bench


def test_silo_ls_has_a_row_for_a_logger_whose_helper_is_down(down, capsys) -> None:
    assert run(["ls"]) == 0
    shown = capsys.readouterr()
    (row,) = [line for line in shown.out.splitlines() if line.startswith(f"bot.{os.getpid()}")]
    assert "helper down" in row
    assert "its helper process is down since" in shown.err
    assert "logging goes on" in shown.err


def test_who_asks_for_a_logger_that_is_down_is_told_so(down, capsys) -> None:
    assert run(["info", "bot"]) == EXIT_NO_LOGGER
    assert "nobody can reach it" in capsys.readouterr().err
    with pytest.raises(ConnectionLostError, match="its helper process is down"):
        Client.connect("bot")


@pytest.mark.parametrize("told", [True, False], ids=["said to be down", "not said yet"])
def test_who_connects_meanwhile_waits_for_the_next_helper_process(bench, monkeypatch, told) -> None:
    released, say = threading.Event(), DownMark.set

    def release() -> None:
        broken.undo()
        released.set()

    def say_late(mark: DownMark) -> None:
        released.wait(DEADLINE_S)
        say(mark)

    with monkeypatch.context() as broken:
        broken.setattr(serving, "HelperProcess", no_process)
        if not told:  # its program has not taken in yet that it died
            broken.setattr(DownMark, "set", say_late)
        killed = bench.serving.helper_pid
        os.kill(killed, signal.SIGKILL)
        wait_until(lambda: not discover().loggers and (discover().down or not told))
        threading.Timer(0.3, release).start()
        with Client.connect("bot", timeout_s=DEADLINE_S) as client:
            assert client.status().helper_pid != killed


@pytest.mark.slow
@pytest.mark.parametrize("moment", ["borrow", "root_at", "exchange"])
def test_a_client_comes_to_the_next_helper_process_where_one_dies_while_it_connects(bench, monkeypatch, moment) -> None:
    do = getattr(connection, moment)
    killed: list[int] = []

    def after_a_death(*arguments, **options):
        if not killed:
            killed.append(bench.serving.helper_pid)
            os.kill(killed[0], signal.SIGKILL)
            wait_until(lambda: not process_start(killed[0]))
        return do(*arguments, **options)

    monkeypatch.setattr(connection, moment, after_a_death)
    with Client.connect("bot", timeout_s=min(DEADLINE_S, 60)) as client:
        assert client.table().elements
        assert client.status().helper_pid not in {killed[0], 0}


@pytest.mark.slow
def test_silence_of_a_helper_process_that_was_killed_is_not_taken_for_a_role(bench, client, monkeypatch) -> None:
    exchange, killed = Connection.exchange, []

    def after_a_death(connection, request, timeout_s, **options):
        if options.get("as_change") or (request.key == Do.key and not killed):
            if not killed:
                killed.append(bench.serving.helper_pid)
                os.kill(killed[0], signal.SIGKILL)
                wait_until(lambda: bench.serving.is_up and bench.serving.helper_pid != killed[0])
                raise NoAnswerError("nobody is there")
            if len(killed) == 1:  # the next one has the question, dies before it answers
                killed.append(client._call(client._question).status.helper_pid)
                os.kill(killed[1], signal.SIGKILL)
        return exchange(connection, request, timeout_s, **options)

    monkeypatch.setattr(Connection, "exchange", after_a_death)
    with pytest.raises(ConnectionLostError, match="look whether it was done"):
        client.mark("slipped")
    assert killed


@pytest.mark.slow
def test_a_helper_process_that_dies_of_a_fault_says_where_it_stood(bench, capfd, monkeypatch, tmp_path) -> None:
    # in compiled code that holds Python's lock: other threads, did they go on, would change what is told of them
    faulty = "import faulthandler, signal\nsignal.signal(signal.SIGUSR1, lambda *_: faulthandler._sigsegv())\n"
    (tmp_path / "sitecustomize.py").write_text(faulty)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for number in (signal.SIGKILL, signal.SIGUSR1):  # the second is started while what is said is captured
        before = bench.serving.helper_pid
        os.kill(before, number)
        wait_until(lambda: bench.serving.helper_pid != before and bench.serving.is_up)  # noqa: B023
    said = capfd.readouterr().err
    assert "Segmentation fault" in said
    assert "silo/helper/helper.py" in said


def test_a_client_that_connects_does_not_wait_for_the_helper_process_of_a_program_that_has_ended(bench, monkeypatch):
    tries: list[LoggerAddress] = []

    def gone(_, found: LoggerAddress, __: float) -> None:
        tries.append(found)
        raise NoAnswerError("nobody is there")

    monkeypatch.setattr(connection.Connection, "_open", gone)
    ended = subprocess.Popen(["true"])
    ended.wait()
    found = replace(discover().one("bot"), pid=ended.pid)
    with pytest.raises(ConnectionLostError, match="nobody is there"):
        Client.connect(found, timeout_s=min(DEADLINE_S, 60))
    assert tries == [found]


@pytest.mark.slow
def test_a_helper_process_of_a_newer_silo_serves_a_program_that_was_started_before_the_upgrade(bench, monkeypatch):
    """It knows nothing of the memory in which changes are counted."""
    start = process.ChildProcess.__init__

    def older(self, module, arguments, *more, **options):
        at = arguments.index("--changes-fd")
        start(self, module, arguments[:at] + arguments[at + 2 :], *more, **options)

    monkeypatch.setattr(process.ChildProcess, "__init__", older)
    before = bench.serving.helper_pid
    os.kill(before, signal.SIGKILL)
    wait_until(lambda: bench.serving.helper_pid != before and bench.serving.is_up)
    with silo.connect("bot") as client:
        bench.logger.start()
        wait_until(lambda: client.status().state is State.RUNNING)


MANY_FILES = 4096


@pytest.fixture
def many_files(cold):
    """This program has more open files than `select` can count."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < MANY_FILES:
        pytest.skip("needs a limit of 4096 open files")
    resource.setrlimit(resource.RLIMIT_NOFILE, (MANY_FILES, hard))
    opened = [os.open(os.devnull, os.O_RDONLY) for _ in range(1100)]
    yield
    for descriptor in opened:
        os.close(descriptor)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.slow
@pytest.mark.usefixtures("many_files")
def test_a_program_with_more_than_a_thousand_open_files_is_served_by_one_helper_process_after_the_other(bench) -> None:
    links: list[bool] = []
    with silo.connect("bot") as client:
        client.on_link(links.append)
        client.start()
        bench.ticks(5)
        os.kill(bench.serving.helper_pid, signal.SIGKILL)
        wait_until(lambda: links == [False, True])
        client.stop()
        assert bench.logger._life.state is State.STOPPED
    assert Path(bench.logger.save()).is_file()


@pytest.mark.slow
def test_a_helper_process_that_is_slow_to_start_is_waited_for_while_it_works(new_logger, monkeypatch, tmp_path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import time\nwhile time.process_time() < 2.5: pass\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(process, "READY_TIMEOUT_S", 2.0)  # others may have both processors for longer than a second
    assert new_logger("bot").serve().is_up


@pytest.mark.slow
@pytest.mark.parametrize(
    ("does", "told"),
    [
        ("import signal\nsignal.pause()\n", r"no answer within \d+ s"),
        ("import os\nos._exit(3)\n", r"it ended at once \(exit code 3\); see"),
        ("import os\nos.kill(os.getpid(), 9)\n", r"it ended at once \(exit code -9\); see"),
    ],
)
def test_a_helper_process_that_does_nothing_or_ends_is_given_up(new_logger, monkeypatch, tmp_path, does, told) -> None:
    (tmp_path / "sitecustomize.py").write_text(does)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(process, "READY_TIMEOUT_S", 1.0)
    with pytest.raises(ConnectionLostError, match=f"didn't start: {told}"):
        new_logger("bot").serve()


def test_a_log_that_is_saved_while_the_helper_is_down_has_what_happened(bench, monkeypatch) -> None:
    with Client.connect("bot") as client:
        client.start()
        bench.ticks(20)
        client.mark("pushed", 12)
        folder = bench.logger.options.folder
        wait_until(lambda: any(event.text == "pushed" for event in read_events(folder, "bot")))
    monkeypatch.setattr(serving, "HelperProcess", no_process)
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    wait_until(lambda: not bench.serving.is_up)
    saved = silo.open_log(bench.logger.save().path)
    assert [(event.kind, event.tick) for event in saved.events][-1] == ("marker", 12)
    assert "started" in {event.kind for event in saved.events}


def test_a_closed_logger_is_not_down(down, runtime) -> None:
    down.logger.close()
    assert discover().down == []
    assert list(runtime.glob("*.down")) == []


def test_the_mark_of_a_dead_program_counts_for_nothing_and_is_swept(runtime) -> None:
    down_mark("bot", 1).touch()
    mine = DownMark("mine")
    mine.set()
    assert [path.name for path in down_marks()] == [f"mine.{os.getpid()}.down"]
    assert [path.name for path in sweep_unfinished(runtime)] == ["bot.1.down"]
    mine.clear()
    assert list(runtime.iterdir()) == []


# ------------------------------------------------------------------------------------- the dead beside the living


def test_a_name_means_the_living_logger_and_not_a_dead_one_of_that_name() -> None:
    dead = LoggerAddress("bot", 1, "/run/bot.1.sock", "me", dead=True, since=100.0)
    living = LoggerAddress("bot", 2, "/run/bot.2.sock", "me", since=50.0)
    both = Discovery([dead, living], [])
    assert both.named("bot") == both.named("") == [living]
    assert both.named("bot.1") == [dead]
    assert Discovery([dead], []).named("bot") == [dead]


def test_a_program_that_was_killed_and_started_again_is_opened_whatever_its_old_helper_does(robots) -> None:
    first = robots("bot")
    with Client.connect("bot"):  # for whom its helper process stays
        freeze(first.helper_pid)  # as slow as one that has gigabytes to save
        first.kill()
        again = robots("bot")
        os.kill(first.helper_pid, signal.SIGCONT)
        wait_until(lambda: any(found.dead for found in discover().loggers))
        with Client.connect(f"bot.{first.pid}") as lingering, Client.connect("bot") as client:
            assert client.status().pid == again.pid
            assert lingering.status().pid == first.pid


@pytest.mark.slow
def test_who_watches_a_robot_whose_helper_was_killed_waits_for_the_next_one_though_a_namesake_came(
    robots, monkeypatch
) -> None:
    looked: list[object] = []
    candidates = connection.Connection._candidates

    def seen(one):
        looked.append(candidates(one))
        return looked[-1]

    monkeypatch.setattr(connection.Connection, "_candidates", seen)
    mine = robots("bot")
    with Client.connect("bot") as client:
        robots("bot")
        links: list[bool] = []
        client.on_link(links.append)
        freeze(mine.pid)  # too busy to start another helper process
        os.kill(mine.helper_pid, signal.SIGKILL)
        wait_until(lambda: len(looked) >= 3 or links[-1:] == [True])
        os.kill(mine.pid, signal.SIGCONT)
        wait_until(lambda: links[-1:] == [True])
        assert links == [False, True]
        assert client.status().pid == mine.pid


def test_whether_a_program_lives_is_not_asked_where_its_number_means_another_process_here(client) -> None:
    status, found = client.status(), client._connection.found
    assert connection._program_start(found, status.helper_pid) == process_start(status.pid) > 0
    assert connection._program_start(found, status.pid) == 0  # that is no helper process: counted in a container
    assert connection._program_start(found, 0) == 0
    assert connection._program_start(replace(found, socket=""), status.helper_pid) == 0


@pytest.mark.slow
def test_who_watches_a_robot_that_was_killed_follows_its_next_program_and_no_namesake_that_was_there(
    robots, monkeypatch
) -> None:
    monkeypatch.setattr(connection, "TWIN_SCAN_S", 0.05)
    mine = robots("bot")
    with Client.connect("bot") as client:
        twin = robots("bot")
        wait_until(lambda: len(client._connection._known) == 2)
        mine.kill()
        wait_until(lambda: client.status().state is State.DEAD)
        links: list[bool] = []
        client.on_link(links.append)
        again = robots("bot")
        wait_until(lambda: links[-1:] == [True])
        assert client.status().pid == again.pid != twin.pid


# ------------------------------------------------------------------------------------------ views that can't be fed


@pytest.mark.slow
def test_a_view_that_fails_ends_with_words_and_the_others_go_on(tmp_path, monkeypatch, caplog) -> None:
    frame = ServedView.frame

    def failing(view, *words):
        if view.request.view == "bad-1":
            raise ValueError("shapes (1,) and (2,)")
        return frame(view, *words)

    monkeypatch.setattr(ServedView, "frame", failing)
    parts = Parts(tmp_path)
    try:
        wrong, right = (OpenView(view=name, values=["/log/x"], rate_hz=30.0) for name in ("bad-1", "good-1"))
        assert isinstance(parts.publisher.open_view(wrong), ViewOpened)
        parts.publisher.open_view(right)
        refused = wait_until(
            lambda: isinstance(answer := answered(lambda: parts.publisher.open_view(wrong)), Refused) and answer
        )
        assert "can't be fed any more: ValueError: shapes (1,) and (2,)" in refused.text
        assert isinstance(parts.publisher.open_view(right), ViewOpened)
        assert "view bad-1 failed" in caplog.text
        assert parts.alive()
        parts.publisher.views.close("bad-1")
        assert isinstance(parts.publisher.open_view(wrong), ViewOpened)
    finally:
        parts.end()


@pytest.mark.slow
def test_a_stream_that_fails_ends_with_words_and_the_others_go_on(tmp_path, monkeypatch, caplog) -> None:
    adopt = ServedStream.adopt

    def failing(stream, *words):
        if stream.request.stream == "bad-1" and words[1] is None:
            raise ValueError("shapes (1,) and (2,)")
        return adopt(stream, *words)

    parts = Parts(tmp_path)
    streams = parts.publisher.streams
    try:
        wrong, right = (OpenStream(stream=name, names=["/log/x"]) for name in ("bad-1", "good-1"))
        assert isinstance(streams.open(wrong), StreamOpened)
        streams.open(right)
        monkeypatch.setattr(ServedStream, "adopt", failing)
        refused = wait_until(lambda: isinstance(answer := answered(lambda: streams.open(wrong)), Refused) and answer)
        assert "can't be fed any more: ValueError: shapes (1,) and (2,)" in refused.text
        assert isinstance(streams.open(right), StreamOpened)
        assert "stream bad-1 failed" in caplog.text
        monkeypatch.undo()
        streams.close("bad-1")
        assert isinstance(streams.open(wrong), StreamOpened)
    finally:
        parts.end()


@pytest.mark.slow
def test_what_the_pin_of_a_client_that_is_gone_holds_is_freed_though_nobody_asks_for_pins(tmp_path) -> None:
    class Held:
        """What a pin holds."""

    parts, held = Parts(tmp_path), Held()
    try:
        freed = weakref.ref(held)
        parts.publisher.pins.set("gone-1", held, 0.05)
        del held
        wait_until(lambda: freed() is None)
    finally:
        parts.end()


@pytest.mark.slow
def test_of_hundreds_of_clients_that_go_at_once_none_is_thought_to_be_there(tmp_path) -> None:
    parts = Parts(tmp_path)
    try:
        there, tokens = open_client(parts.path), []
        for count in range(100, 700, 100):
            keys = [Root(parts.replica.host, "fuzz").key("client", ClientId.drawn().id) for _ in range(100)]
            tokens += [there.liveliness().declare_token(key) for key in keys]
            wait_until(lambda: parts.publisher.clients == count)  # noqa: B023
        close(there)
        wait_until(lambda: not parts.publisher.clients)
    finally:
        parts.end()


def test_a_topic_counts_what_no_helper_process_was_there_to_send(bench, client) -> None:
    topic, values = client.topic("/log/x"), []
    bench.logger.start()

    def heard(of: int) -> bool:
        bench.ticks(1)
        for batch in topic.read():
            values.extend(batch.values.tolist())
        return len(values) > of

    wait_until(lambda: heard(0))
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    bench.ticks(50)
    before = len(values)
    wait_until(lambda: heard(before))
    assert topic.missed == values[-1] - values[0] + 1 - len(values) > 0


def test_a_stream_goes_on_where_it_was_with_another_helper_process(bench, client) -> None:
    stream, values = client.stream(["x"]), []
    bench.logger.start()

    def heard(of: int) -> bool:
        bench.ticks(1)
        while (batch := stream.read(0)) is not None:
            values.extend(batch["x"].values.tolist())
        return len(values) > of

    wait_until(lambda: heard(0))
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    bench.ticks(50)
    wait_until(lambda: heard(len(values) + 50))
    assert (stream.missed, values) == (0, [1.0 + at for at in range(len(values))])
