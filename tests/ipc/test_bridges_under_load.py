"""What bridges do where samples come late and viewers go: no tick is left out, nobody else misses anything."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import serve

from silo.bridges.feed import Listener, LoggerFollower
from silo.bridges.foxglove.server import Viewer
from silo.bridges.ros2.graph import GraphTopic
from silo.bridges.ros2.pairing import MOST_WAITING, Pairing
from silo.history.arrays import SampleArrays


def samples(first: int, last: int) -> SampleArrays:
    ticks = np.arange(first, last + 1)
    return SampleArrays(ticks, ticks * 1000, ticks.astype(float).reshape(-1, 1))


def paired(pairing: Pairing, **batch: SampleArrays) -> list[int]:
    q, qd = pairing.take(batch)
    assert q.ticks.tolist() == qd.ticks.tolist() == q.values[:, 0].tolist()
    assert (q.time_ns == q.ticks * 1000).all()
    return q.ticks.tolist()


def test_ticks_wait_until_the_other_ring_was_read_as_far() -> None:
    pairing = Pairing(["q", "qd"])
    assert paired(pairing, q=samples(0, 4), qd=samples(0, 5)) == [0, 1, 2, 3, 4]
    assert paired(pairing, q=samples(5, 9), qd=samples(6, 9)) == [5, 6, 7, 8, 9]
    assert paired(pairing, q=samples(10, 12)) == []
    assert paired(pairing, qd=samples(10, 11)) == [10, 11]
    assert paired(pairing, qd=samples(12, 12)) == [12]
    assert pairing.unpaired == 0


def test_a_tick_whose_partner_was_lost_is_counted_and_holds_up_none() -> None:
    pairing = Pairing(["q", "qd"])
    assert paired(pairing, q=samples(0, 5), qd=samples(3, 4)) == [3, 4]
    assert paired(pairing, qd=samples(6, 6), q=samples(6, 6)) == [6]
    assert pairing.unpaired == 1  # 5: before 3 the one stream had not begun


def test_another_run_begins_anew() -> None:
    pairing = Pairing(["q", "qd"])
    assert paired(pairing, q=samples(100, 105), qd=samples(100, 104)) == [100, 101, 102, 103, 104]
    assert paired(pairing, q=samples(0, 2), qd=samples(0, 2)) == [0, 1, 2]


def test_what_waits_is_bounded_and_counted() -> None:
    pairing = Pairing(["q", "qd"])
    assert paired(pairing, q=samples(0, MOST_WAITING + 99)) == []
    assert pairing.unpaired == 100
    assert paired(pairing, qd=samples(0, MOST_WAITING + 99))[0] == 100


def test_joint_states_have_every_tick_however_the_rings_are_read() -> None:
    encoded = []

    def encode(of: list[SampleArrays]) -> tuple[np.ndarray, list[bytes]]:
        encoded.append([one.ticks.tolist() for one in of])
        return of[0].time_ns, [b"x"] * len(of[0])

    outlet = SimpleNamespace(elements=("/log/q", "/log/qd"), encode=encode)
    topic = GraphTopic(b"", None, None, outlet=outlet, is_watched=True)
    batches = [{"/log/q": samples(0, 4), "/log/qd": samples(0, 5)}, {"/log/q": samples(5, 9), "/log/qd": samples(6, 9)}]
    times = [time_ns for batch in batches for time_ns, _ in topic.messages(batch)]
    assert times == [tick * 1000 for tick in range(10)]


def test_a_feed_remembers_what_was_passed_on_of_the_newest_run_alone() -> None:
    feed = LoggerFollower(lambda: None, Listener(print, print, print))
    for run in range(50):
        assert len(feed._unseen(f"run {run}", "/log/q", samples(0, 9))) == 10
        assert len(feed._unseen(f"run {run}", "/log/q", samples(5, 14))) == 5
    assert len(feed._last_tick) == 1


@pytest.mark.slow
def test_a_viewer_that_says_good_bye_under_load_breaks_nothing() -> None:
    async def scene() -> None:
        viewers: list[Viewer] = []
        met, gone = asyncio.Event(), asyncio.Event()

        async def meet(connection) -> None:
            viewers.append(Viewer(connection))
            met.set()
            await connection.wait_closed()
            gone.set()

        async with serve(meet, "127.0.0.1", 0, close_timeout=60.0) as server:
            async with connect(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}") as client:
                await met.wait()
                viewers[0].write(b"\x81\x01a")
                assert await client.recv() == "a"
                client.transport.pause_reading()  # it is busy, and closes its link later
                client.protocol.send_close(1000)
                client.send_data()
                while not viewers[0].connection.protocol.eof_sent:
                    await asyncio.sleep(0.001)
                viewers[0].write(b"\x81\x01b")  # what the others are sent, too
                client.transport.resume_reading()
            await gone.wait()

    asyncio.run(scene())
