"""What a view and a history say is what was logged: every type, every sample, and why there is none."""

from types import SimpleNamespace

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.arrays.columns import ColumnStore, Gap, NonFinite, grid_of, holes_of
from silo.core.elements import BufferType, Edit, ElementOptions
from silo.history.requests import GetHistory
from silo.history.server import history
from silo.segment.reader import SegmentReader
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

COLUMN_NS = 100_000_000
LIVE = silo.Action.SAVE_AND_PUBLISH
BIG = 2**62


@pytest.fixture
def odd(runtime, tmp_path):
    """A logger with values that a float64 can't tell, and its clock."""
    clock = [1_700_000_000_000_000_000]
    logger = silo.Logger("odd", frequency=100, max_time=10, folder=tmp_path, clock=lambda: clock[0])
    values = {
        "count": np.zeros((), "i8"), "unsigned": np.zeros((), "u8"), "when": np.zeros((), "M8[ns]"),
        "moment": np.zeros((), "M8[s]"), "raw": np.zeros((), "S4"), "float": np.zeros(()),
    }  # fmt: skip
    for name, value in values.items():
        logger.add(value, name, action=LIVE)
    serving = logger.serve()
    logger.start()

    def tick(**new):
        for name, value in new.items():
            values[name][...] = value
        logger.collect()
        clock[0] += 10_000_000

    yield tick, clock
    serving.close()
    logger.close()


def newest(client, names, tick, until):
    with client.view([f"/log/{name}" for name in names], rate_hz=30) as view:
        return until(lambda: (frame := view.frame()) and frame.tick == tick and frame)


def test_large_integers_dates_and_bytes_that_are_no_text_come_whole(odd, until):
    tick, _ = odd
    when, nat = np.datetime64(1_790_000_000_123_456_789, "ns"), np.datetime64("NaT")
    tick(count=BIG + 1, unsigned=2**64 - 1, when=when, moment=nat, raw=b"\xffab")
    with Client.connect("odd") as client:
        frame = newest(client, ["count", "unsigned", "when", "moment", "raw"], 1, until)
    assert list(frame.texts.values()) == [
        str(BIG + 1),
        str(2**64 - 1),
        "2026-09-21T14:13:20.123456789",
        "NaT",
        "\\xffab",
    ]
    assert list(frame.texts) == list(range(5))
    assert np.isnan(frame.newest[3])


@pytest.mark.parametrize("source", ["view", "history"])
def test_columns_of_a_counter_near_2_62_are_exact(odd, until, source):
    tick, clock = odd
    begin = clock[0]
    with Client.connect("odd") as client, client.view(plots=["/log/count"], rate_hz=30, column_ns=COLUMN_NS) as view:
        store = ColumnStore(["/log/count"], 3, COLUMN_NS)
        for number in range(30):
            tick(count=BIG + number)

        def follow():
            if (frame := view.frame()) is not None:
                store.merge(frame.plots, grid_of(frame.first, frame.low, frame.high, frame.marks, frame.bases))
            return frame is not None and frame.tick == 30

        until(follow)
        if source == "history":
            store = ColumnStore(["/log/count"], 3, COLUMN_NS)
            store.take(client.history(["/log/count"], begin, clock[0], COLUMN_NS))
    low, high = ([store.bases[0] + int(end) for end in ends[0]] for ends in (store.low, store.high))
    assert low == [BIG, BIG + 10, BIG + 20]
    assert high == [BIG + 9, BIG + 19, BIG + 29]


def test_columns_tell_of_nan_and_inf_beside_their_numbers(odd):
    tick, clock = odd
    begin = clock[0]
    for value in [1.0, np.nan, 2.0, *[3.0] * 7, np.inf, *[4.0] * 9, *[-np.inf] * 10, *[5.0] * 10]:
        tick(float=value)
    with Client.connect("odd") as client:
        past = client.history(["/log/float"], begin, clock[0], COLUMN_NS)
    assert past.marks.tolist() == [[NonFinite.NAN, NonFinite.POS_INF, NonFinite.NEG_INF, 0]]
    np.testing.assert_array_equal(past.low, [[1, 4, np.nan, 5]])
    np.testing.assert_array_equal(past.high, [[3, 4, np.nan, 5]])


# ---------------------------------------------------------------------------------------------------------- holes


def why_empty(client, bench, name, begin_ns, columns):
    past = client.history([name], begin_ns, begin_ns + columns * COLUMN_NS, COLUMN_NS)
    marks = np.zeros(past.low.shape, np.uint8) if past.marks is None else past.marks
    return [
        Gap(int(hole)) if np.isnan(low) else None for hole, low in zip(holes_of(marks)[0], past.low[0], strict=True)
    ]


def test_history_before_the_start_and_of_what_was_overwritten_says_so(bench, client):
    client.apply([Edit("/log/kept", ElementOptions(size=10, buffer=BufferType.LOOPING))], -1)
    client.start()
    bench.ticks(1000)
    assert why_empty(client, bench, "/log/x", bench.begin_ns - 2 * COLUMN_NS, 3) == [Gap.BEFORE, Gap.BEFORE, None]
    found = why_empty(client, bench, "/log/kept", bench.begin_ns, 100)
    assert found[:50] == [Gap.OVERWRITTEN] * 50
    assert found[-1] is None


def test_history_of_a_full_buffer_that_is_not_published_and_of_an_element_that_is_off_says_so(bench, client):
    fixed, off = ElementOptions(size=10, buffer=BufferType.FIXED), ElementOptions(enabled=False)
    client.apply([Edit("/log/kept", fixed), Edit("/log/slow", off)], -1)
    client.start()
    bench.ticks(40)
    assert why_empty(client, bench, "/log/kept", bench.begin_ns, 4) == [None, Gap.FULL, Gap.FULL, Gap.FULL]
    assert why_empty(client, bench, "/log/slow", bench.begin_ns, 2) == [Gap.OFF, Gap.OFF]


class Racing(SegmentReader):
    """A reader whose copies always take so long that the writer goes on meanwhile."""

    def __init__(self, path, write):
        super().__init__(path)
        self.write = write

    def _copy(self, ring, begin, end, words=None):
        words = super()._copy(ring, begin, end, words)
        self.write()
        return words


def test_history_is_whole_though_its_oldest_rows_are_overwritten_while_they_are_read(monkeypatch, tmp_path):
    monkeypatch.setattr("silo.history.picking.BLOCK_BYTES", 8 * 100 * 3)  # ten blocks: x has three words a row
    clock = [0]
    logger = silo.Logger("race", frequency=100, max_time=0, folder=tmp_path, clock=lambda: clock[0])
    x = np.zeros(())
    options = {"buffer": BufferType.LOOPING, "size": 1000}
    logger.add(x, "x", action=LIVE, **options)
    logger.start()

    def tick():
        clock[0] += 10_000_000
        x[...] = clock[0]
        logger.collect()

    for _ in range(5000):
        tick()
    reader = Racing(logger._present.run.segment.path, tick)
    head_ns = clock[0]
    request = GetHistory(names=["/log/x"], start_ns=0, end_ns=head_ns + 1, column_ns=COLUMN_NS)
    now = SimpleNamespace(found=lambda name: (name, 0), entry=lambda found: found)
    found = history(request, now, reader)
    reader.close()
    logger.close()
    there = np.flatnonzero(~np.isnan(np.frombuffer(found.low)))
    assert there[-1] == head_ns // COLUMN_NS
    assert len(there) > 80  # of a hundred columns that the ring holds
    assert (np.diff(there) == 1).all()


# --------------------------------------------------------------------------------------------------- frames that fail


def test_the_first_frame_says_from_when_on_it_is_whole_and_ordinary_numbers_need_no_marks_and_no_bases(
    bench, client, until
):
    client.start()
    bench.ticks(500)
    with client.view(plots=["/log/x", "/log/q_x"], rate_hz=30, column_ns=COLUMN_NS) as view:
        first = until(view.frame)
        bench.ticks(30)
        second = until(view.frame)
    assert bench.begin_ns < first.since_ns <= bench.now_ns
    assert second.since_ns == 0
    assert (second.marks, second.bases) == (None, {})


def test_a_view_begins_with_a_second_however_old_its_first_row_is(odd, until):
    tick, clock = odd
    tick(float=1.0)
    clock[0] += 600 * 10**9
    tick(float=2.0)
    with Client.connect("odd") as client, client.view(plots=["/log/float"], rate_hz=30, column_ns=COLUMN_NS) as view:
        first = until(view.frame)
    assert first.low.shape[1] <= 12
    assert first.low[0, -1] == 2.0
    assert clock[0] - 2 * 10**9 < first.since_ns <= clock[0]


def test_a_store_asks_for_the_history_until_it_reaches_the_frames():
    store = ColumnStore(["a"], 10, 100)
    assert not store.gapped
    store.live_since_ns, store.past_until_ns = 500, 450
    assert store.gapped
    store.past_until_ns = 500
    assert not store.gapped


def test_after_an_edit_a_frame_tells_the_sizes_of_the_recording_that_is_held(bench, client):
    bench.start(3)
    bench.logger.stop()
    bench.logger.set("x", size=50_000)
    with client.view(["/log/x", "/log/q"], []) as view:
        # the helper process may not have heard of the edit when it makes the first frame
        wait_until(lambda: (frame := view.frame()) is not None and frame.sizes == {0: 1000})
        bench.logger.start()
        wait_until(lambda: (frame := view.frame()) is not None and frame.sizes == {})
