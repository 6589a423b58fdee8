"""Finding moments in a real helper process: in all that buffers and pins hold, judged on every sample."""

import numpy as np
import pytest

import silo
from silo.core.elements import BufferType, Edit, ElementOptions, Sought
from silo.errors import RefusedError
from silo.history.search import MAX_MOMENTS, MAX_NAMES, MAX_PINS, check_moments
from silo.history.search_requests import FindMoments
from silo.rpc.refusals import RequestRefusedError
from tests.waiting import wait_until


def short_buffer(client, name, size):
    client.apply([Edit(name, ElementOptions(size=size, buffer=BufferType.LOOPING, action=silo.Action.SAVE))], -1)


def spiked(bench, at, ticks):
    """Tick so often; one sample of q_x is 40."""
    for tick in range(ticks):
        bench.q[:] = (40 if tick == at else tick % 7), 0, 0
        bench.ticks(1)


def test_a_spike_of_one_sample_is_found_in_all_that_is_held_also_of_a_derived_signal(bench, client):
    bench.logger.derive("sum", "q_x + q_y")
    wait_until(lambda: client.table().derived)
    client.start()
    spiked(bench, 123, 300)
    at = [bench.begin_ns + 123 * bench.tick_ns]
    found = client.find(["/log/q_x"], "highest")["/log/q_x"]
    assert (found.total, found.time_ns.tolist(), found.values.tolist()) == (1, at, [40])
    assert (found.begin_ns, found.end_ns) == (bench.begin_ns, bench.begin_ns + 299 * bench.tick_ns)
    found = wait_until(lambda: (some := client.find(["/log/sum"], "highest")["/log/sum"]).total and some)
    assert (found.time_ns.tolist(), found.values.tolist()) == (at, [40])


def test_an_answer_is_bounded_and_counts_all_and_what_nobody_has_is_refused_or_empty(bench, client):
    client.start()
    spiked(bench, -1, 300)
    around = bench.begin_ns + 150 * bench.tick_ns
    found = client.find(["/log/q_x"], "crossing", 3.0, 1, around_ns=around, most=4)["/log/q_x"]
    rising = [bench.begin_ns + tick * bench.tick_ns for tick in range(300) if tick % 7 == 3]
    assert (found.total, len(found.time_ns)) == (len(rising), 4)
    assert found.time_ns.tolist() == rising[found.before : found.before + 4]
    assert found.time_ns[1] < around <= found.time_ns[2]
    assert client._measure(["/log/q_x"], 0, 1)["/log/q_x"].samples == 0
    for name, end_ns, why in (("/log/nope", 1, "nope"), ("/log/q_x", 2**63 - 1, "out of range")):
        with pytest.raises(RefusedError, match=why):
            client._measure([name], 0, end_ns)


def test_a_pin_of_a_run_before_is_looked_through_alone(bench, client):
    client.start()
    spiked(bench, 30, 50)
    with client.pin(["/log/q_x"], 0, 2**61) as pin:
        client.restart("discard")
        spiked(bench, -1, 50)
        found = client.find(["/log/q_x"], "highest", pins=[pin], run=pin.opened.run)["/log/q_x"]
    assert (found.total, found.values.tolist()) == (1, [40])


def test_rows_that_a_pin_has_are_looked_through_and_measured_when_the_buffer_has_lost_them(bench, client):
    short_buffer(client, "/log/q", 100)
    client.start()
    spiked(bench, 60, 100)
    with client.pin(["/log/q_x"], 0, bench.begin_ns + 99 * bench.tick_ns) as pin:
        spiked(bench, -1, 400)
        alone = client.find(["/log/q_x"], "highest")["/log/q_x"]
        with_pin = client.find(["/log/q_x"], "highest", pins=[pin])["/log/q_x"]
        all_of = client.find(["/log/q_x"], "change", pins=[pin], most=1000)["/log/q_x"]
        assert alone.values.max() == 6
        assert (with_pin.time_ns.tolist(), with_pin.values.tolist()) == ([bench.begin_ns + 60 * bench.tick_ns], [40])
        assert np.all(np.diff(all_of.time_ns) > 0)
        begin, end = bench.begin_ns + 20 * bench.tick_ns, bench.begin_ns + 450 * bench.tick_ns
        found = client._measure(["/log/q_x"], end, begin, [pin], pin.opened.run)["/log/q_x"]
        alone = client._measure(["/log/q_x"], end, begin)["/log/q_x"]
        assert (alone.largest, found.largest) == (6, 40)
        assert found.samples == alone.samples + 80
        inside = np.array([40 if tick == 60 else tick % 7 for tick in range(20, 100)], float)
        till = bench.begin_ns + 99 * bench.tick_ns
        held = client._measure(["/log/q_x"], begin, till, [pin], pin.opened.run)["/log/q_x"]
        assert (held.at_a, held.at_b, held.samples) == (20 % 7, 99 % 7, 80)
        assert np.allclose([held.mean, held.std, held.rms], [inside.mean(), inside.std(), np.sqrt((inside**2).mean())])


FAR = 2**62
TWO = ["/log/x", "/log/y"]


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        ({"names": []}, {"names": ["/log/x"]}, "ask for 1 to 64 names, got 0"),
        ({"names": ["/log/x"] * (MAX_NAMES + 1)}, {"names": ["/log/x"] * MAX_NAMES}, "got 65"),
        ({"most": 0}, {"most": 1}, "most must be 1 to 5000 moments of each name, got 0"),
        ({"most": MAX_MOMENTS // 2 + 1}, {"most": MAX_MOMENTS // 2}, "got 5001"),
        ({"start_ns": 2, "end_ns": 1}, {"start_ns": 1, "end_ns": 1}, "goes backwards"),
        ({"start_ns": -FAR - 1}, {"start_ns": -FAR}, "out of range"),
        ({"end_ns": FAR + 1}, {"end_ns": FAR}, "out of range"),
        ({"around_ns": FAR + 1}, {"around_ns": FAR}, "around_ns"),
        ({"around_ns": -FAR - 1}, {"around_ns": -FAR}, "around_ns"),
        ({"bounds": [(0.0, 1.0)]}, {"bounds": [(0.0, 1.0)] * 2}, "bounds are of every name or of none, got 1 for 2"),
        ({"pins": ["p"] * (MAX_PINS + 1)}, {"pins": ["p"] * MAX_PINS}, "at most 16 pins, got 17"),
        ({"level": float("nan")}, {"level": float("inf")}, "the level must be a number"),
        ({"direction": 2}, {"direction": -1}, "the direction -1, 0 or 1"),
    ],
)
def test_what_can_not_be_looked_for_is_refused_before_anything_is_read(wrong, right, says):
    usual = {"names": TWO, "most": 10}
    check_moments(FindMoments(what=Sought.CROSSING, **usual | right))
    with pytest.raises(RequestRefusedError, match=says):
        check_moments(FindMoments(what=Sought.CROSSING, **usual | wrong))
