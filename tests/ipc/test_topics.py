"""Reading topics: loops, timeouts, asyncio, names that are not there, elements that come and go."""

import asyncio
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace

import silo
from silo.bridges.messages import entry_values
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import State
from silo.errors import ConnectionLostError, ElementError
from silo.live import topics
from silo.live.topics import encoding_of
from silo.net.keys import Root
from silo.rpc.words import why_silent
from silo.segment.reader import SegmentReader
from tests.stand_ins.ticking import turning
from tests.waiting import DEADLINE_S, wait_until


@pytest.fixture
def running(bench):
    """A loop of its own, as a robot has it."""
    bench.logger.start()
    with turning(lambda: bench.ticks(1), 0.002):
        yield bench


def test_a_loop_over_a_topic_gets_each_sample_once(running, client):
    firsts, values = [], []
    with client.topic("x") as topic:
        for batch in topic:
            firsts.append(batch.first)
            values += batch.values.tolist()
            if len(firsts) == 3:
                break
    assert np.diff(values).tolist() == [1] * (len(values) - 1)


def test_topics_and_streams_have_each_sample_over_cuts(running, client):
    topic, stream, found = client.topic("x"), client.stream(["x"], 0.02), {"topic": [], "stream": []}

    def read():
        for batch in topic.read():
            found["topic"] += batch.values.tolist()
        while (batch := stream.read(0.0)) is not None:
            found["stream"] += batch["x"].values.tolist()

    def has_read(value):
        read()
        return all(values and values[-1] >= value for values in found.values())

    wait_until(lambda: has_read(1))
    for number in range(3):
        begin = running.x.item()
        wait_until(lambda begin=begin: running.x > begin + 20)
        running.logger.set("slow", divider=2 + number, cut=True)
        wait_until(lambda begin=begin: has_read(begin + 40))
    topic.close()
    stream.close()
    for name, values in found.items():
        missing = set(np.arange(values[0], values[-1] + 1)) - set(values)
        assert len(values) == len(set(values)) == values[-1] - values[0] + 1, (name, sorted(missing))


def test_topics_have_their_values_where_rings_and_places_in_them_change(bench, client):
    bench.logger.start()
    topics = {name: client.topic(name) for name in ("gait", "mixed", "slow")}
    values = {name: [] for name in topics}

    def read():
        for name, topic in topics.items():
            for batch in topic.read():
                values[name] += batch.values.tolist()
        return all(values.values())

    def tick():
        number = bench.x.item() + 1
        bench.gait[...], bench.mixed["a"], bench.mixed["n"] = number % 3, number, number
        bench.ticks(1)
        return read()

    wait_until(tick)
    for number in range(14):
        changed = ({"q": {"enabled": bool(number % 2)}}, {"slow": {"divider": 2 + number % 4}},
                   {"x": {"divider": 1 + number % 3}})[number % 3]  # fmt: skip
        for name, options in changed.items():
            bench.logger.set(name, cut=True, **options)
        for _ in range(4):
            tick()
    end = int(bench.x.item())
    wait_until(lambda: read() and values["mixed"][-1][0] >= end)
    numbers = [number for _, number in values["mixed"]]
    assert [value for value, _ in values["mixed"]] == numbers
    assert numbers == list(range(numbers[0], end + 1))
    assert values["gait"][-len(numbers) :] == [number % 3 for number in numbers]
    assert set(np.diff(values["slow"])) <= {1.0, 2.0, 3.0, 4.0, 5.0}
    assert [topic.missed for topic in topics.values()] == [0, 0, 0]
    for topic in topics.values():
        topic.close()


def test_topics_and_streams_have_every_run_of_a_burst(bench, client):
    """Episodes of a fast simulation: the helper process sees but some of them as the present one."""
    client.derive("twice", "2 * x")
    bench.start(1)
    topic, stream, found = (
        client.topic("x"),
        client.stream(["x", "twice"], 0.2),
        {"topic": [], "stream": [], "twice": []},
    )

    def has_read(value):
        for batch in topic.read():
            found["topic"] += batch.values.tolist()
        while (batch := stream.read(0.0)) is not None:
            found["stream"] += batch["x"].values.tolist() if "x" in batch else []
            found["twice"] += (batch["twice"].values / 2).tolist() if "twice" in batch else []
        return all(values and values[-1] >= value for values in found.values())

    def lively():
        bench.ticks(1)
        return has_read(2)

    wait_until(lively)
    begin = bench.x.item()
    for _ in range(20):
        bench.logger.restart()
        bench.ticks(10)
    end = bench.x.item()
    wait_until(lambda: has_read(end))
    topic.close()
    stream.close()
    for name, values in found.items():
        burst = [value for value in values if value > begin]
        assert burst == list(np.arange(begin + 1, end + 1)), name


def test_a_stream_has_every_run_of_a_burst_from_its_opening_on(bench, client):
    bench.start(1)
    wait_until(lambda: client.status().ticks)
    with client.stream(["x"], 0.2) as stream:
        for _ in range(20):
            bench.logger.restart()
            bench.ticks(10)
        found = []
        while len(found) < 200 and (batch := stream.read(DEADLINE_S)) is not None:
            found += batch["x"].values.tolist()
    assert found == list(range(2, 202))


@pytest.mark.parametrize("again", [False, True], ids=["first start", "start after a stop"])
def test_a_topic_that_is_open_before_the_start_has_the_first_sample(bench, client, again):
    if again:
        bench.start(3)
        bench.logger.stop()
        wait_until(lambda: client.status().state is State.STOPPED)
    opened = [client.topic("x"), client.topic("slow")]
    client.status()  # behind the subscriptions
    bench.logger.start()
    with turning(lambda: bench.ticks(1), 0.002):
        for topic in opened:
            assert topic.read(timeout_s=DEADLINE_S)[0].first == 0


def test_who_comes_in_the_midst_of_a_run_gets_what_comes_from_then_on(bench, client):
    early = client.topic("x")
    client.status()
    bench.logger.start()
    with turning(lambda: bench.ticks(1), 0.002):
        assert early.read(timeout_s=DEADLINE_S)[0].first == 0
        wait_until(lambda: bench.x > 50 and early.read())
        assert client.topic("slow").read(timeout_s=DEADLINE_S)[0].first >= 10


@pytest.mark.parametrize(("rounds", "first"), [(0, []), (1, [0])], ids=["new helper", "there before"])
def test_whoever_is_there_before_a_run_begins_has_it_whole_and_a_new_helper_process_sends_nothing_again(
    tmp_path, monkeypatch, rounds, first
):
    sent: list[int] = []
    publisher = SimpleNamespace(put=lambda _, attachment: sent.append(int.from_bytes(attachment[:8], "little")))
    session = SimpleNamespace(declare_publisher=lambda *_, **__: publisher)
    monkeypatch.setattr(topics, "matching", lambda _: True)
    with silo.Logger("solo", folder=tmp_path, frequency=100) as log:
        log.array("x", 3, action="publish")
        served = topics.Topics(session, Root("here", "solo"), lambda _, present: present)
        for _ in range(rounds):
            served.publish(0.0)
        log.start()
        log.collect()
        served.adopt(SegmentReader(log._present.path), 0.0)
        served.publish(0.0)
        assert sent == first
        log.collect()
        served.publish(0.1)
        assert sent == [*first, 1]


def test_a_loop_ends_when_its_topic_is_closed(bench, client):
    topic = client.topic("/log/x")
    closing = threading.Timer(0.05, topic.close)
    closing.start()
    assert list(topic) == []
    closing.join()


def test_a_read_with_a_timeout_waits_for_the_first_batch(running, client):
    with client.topic("x") as topic:
        assert len(topic.read(timeout_s=30.0)) > 0


def test_a_read_with_a_timeout_ends_empty_where_nothing_comes(bench, client):
    with client.topic("x") as topic:
        assert topic.read(timeout_s=0.01) == []


def test_asyncio_reads_topics_while_other_tasks_go_on(running, client):
    async def main():
        with client.topic("x") as topic:
            async for batch in topic:
                assert len(batch) > 0
                break
            return await topic.read_async(30.0)

    assert asyncio.run(main())


def test_a_loop_over_what_is_not_published_says_what_to_do(bench, client):
    with pytest.raises(
        ElementError,
        match=r"'/log/kept' is saved but not published.*`silo set bot\.\d+ /log/kept on action=both --cut`",
    ):
        next(iter(client.topic("kept")))
    status, table = client.status(), client.table()
    with pytest.raises(ConnectionLostError, match="killed"):  # of a dead program there is nothing to be set
        why_silent("/log/kept", "bot", replace(status, state=State.DEAD, reason="killed"), table)
    bench.logger.start()
    bench.ticks(3)  # what is said works also while it runs
    assert run(["set", "bot", "kept", "on", "action=both", "--cut"]) == 0
    assert not why_silent("/log/kept", "bot", client.status(), client.table())


def test_a_topic_and_a_client_say_what_they_are(bench, client):
    topic = client.topic("q")
    assert repr(topic) == "<Topic /log/q: open>"
    topic.close()
    assert repr(topic) == "<Topic /log/q: closed>"
    assert repr(client).startswith("<Client of bot.")
    assert repr(client).endswith("connected>")
    assert "<td>bot." in client._repr_html_()


def test_views_show_the_right_rows_after_an_element_was_removed(bench, client):
    view = client.view(["/log/x", "/log/q", "/log/gait"], rate_hz=30)
    bench.logger.remove("q")
    bench.logger.array("late", action="both")
    bench.start(4)

    def newest():
        frame = view.frame()
        return None if frame is None or not len(frame.newest) else frame

    frame = wait_until(lambda: (f := newest()) is not None and f.newest[0] == 4 and f)
    assert frame.newest.tolist() == [4.0, 0.0]
    assert [info.name for info in client.table().elements][-2:] == ["/log/kept", "/log/late"]
    assert "/log/q" not in [info.name for info in client.table().elements]
    view.close()


@pytest.mark.slow
def test_complex_numbers_arrive_as_they_were_logged(runtime, tmp_path):
    log = silo.Logger("bot", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml")
    several, one = log.array("several", (2, 1), "c16", action="both"), log.array("one", (), "c8", action="both")
    log.array("pair", (), [("real", "f8"), ("imag", "f8")], action="both")
    with log.serve(), Client.connect("bot") as client:
        log.start()
        with client.topic("several") as topic, client.stream(["several", "one"], 0.02) as stream:
            found = []

            def lively():
                several[:], one[...] = [[1 + 2j], [3 - 4j]], 5 - 6j
                log.collect()
                found.extend(topic.read())
                return found

            wait_until(lively)
            batch = stream.read(DEADLINE_S)
        held, new = client.samples(["several", "one"]), log.read_new_values("several")
        for values in (found[0].values, batch["several"].values, held["several"].values, new.values):
            assert (values.dtype, values[0].tolist()) == (np.complex128, [[1 + 2j], [3 - 4j]])
        for values in (batch["one"].values, held["one"].values):
            assert (values.dtype, values.ndim, values[0]) == (np.complex64, 1, 5 - 6j)
        assert [entry_values(held["several"], at)[0] for at in range(4)] == [1, 2, 3, -4]
        assert [entry_values(held["one"], at)[0] for at in range(2)] == [5, -6]
        assert client.samples(["pair"])["pair"].values.dtype == np.float64  # as ever: no complex number
        assert client.samples(["one_imag"])["one_imag"].values.dtype == np.float32
    log.close(discard=True)


@pytest.mark.slow
def test_an_element_of_more_types_than_an_encoding_has_room_for_arrives_as_it_was_logged(runtime, tmp_path):
    motor = [("mode", "u1"), ("q", "f4"), ("dq", "f4"), ("tau", "f4"), ("temperature", "i2")]
    with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
        motors = log.array("motors", (), [(f"motor{number}", motor) for number in range(12)], action="both")
        log.serve()
        log.start()
        count = 0

        def tick():
            nonlocal count
            count += 1
            for place, name in enumerate(motors.dtype.names):
                motors[name] = (count % 256, count, place, -count, place)
            log.collect()

        with Client.connect("bot") as client, client.topic("motors") as topic, turning(tick, 0.002):
            first = wait_until(topic.read)[0]
            batches = [first, *wait_until(topic.read)]
            assert client.status().ticks  # who looks at a topic costs nobody else a thing
        values = np.concatenate([batch.values for batch in batches])
        numbers = values["_motor11_q"]
        assert numbers.tolist() == list(range(first.first + 1, first.first + 1 + len(values)))
        assert values["_motor11_tau"].tolist() == (-numbers).tolist()
        assert (values["_motor11_temperature"] == 11).all()
        assert values["_motor0_mode"].tolist() == (numbers % 256).tolist()
        assert topic.missed == 0


@pytest.mark.slow
@pytest.mark.parametrize("letters", [223, 224])  # of an encoding of 255 bytes, and of one more
def test_the_longest_encoding_that_zenoh_takes_is_one_and_a_longer_one_is_attached(letters, runtime, tmp_path):
    name = "m" * letters
    with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
        pair = log.array("q", (), [(name, "f4"), ("b", "i2")], action="both")
        log.serve()
        log.start()

        def tick():
            pair[name] += 1
            log.collect()

        with Client.connect("bot") as client, client.topic("q") as topic, turning(tick, 0.002):
            (batch, *_) = wait_until(topic.read)
        assert batch.values.dtype.names == (f"_{name}", "_b")
        assert batch.values[f"_{name}"][0] == batch.first + 1
        (element,) = (one for one in log._present.run.segment.schema.elements if one.info.name == "/log/q")
        assert len(encoding_of(element)) == letters + 32
