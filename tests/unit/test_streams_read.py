"""What a reader of a stream is given of frames: each row once, and each gap counted where it is."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from silo.history import arrays
from silo.history.arrays import Stream
from silo.history.requests import (
    OpenStream,
    SampledEntry,
    SampledName,
    SampledRows,
    StreamFrame,
    StreamLayout,
    StreamOpened,
)
from silo.net.keys import Root


def rows(first: int, count: int, group: int = 0) -> SampledRows:
    ticks = np.arange(first, first + count)
    return SampledRows(group, first, count, np.stack([ticks, 10 * ticks, ticks], 1).astype("<i8").tobytes())


@pytest.fixture
def stream():
    one = Stream(OpenStream(stream="a-1", names=["x", "y"]), 1, lambda: None, lambda _: None)
    entries = [SampledEntry("", "<i8", 16, False)]
    one.accept(StreamOpened("a-1", 0, [SampledName(name, at, 1, (), entries) for at, name in enumerate("xy")], {}))
    return one


def comes(stream, run, *found, generation=0, earlier=-1):
    """A frame comes, and nobody reads it yet."""
    data = msgspec.msgpack.encode(StreamFrame(generation, run, list(found), earlier))
    stream._take(SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: data)))


def came(stream, run, *found):
    """The values of each name of the next batch, and what was missed before its first; None without a batch."""
    comes(stream, run, *found)
    batch = stream.read(0)
    return batch and {name: (some.values.tolist(), some.missed) for name, some in batch.items()}


def test_it_begins_with_what_comes_and_counts_gaps(stream):
    assert came(stream, "a", rows(5, 2)) == {"x": ([5, 6], 0)}
    assert came(stream, "a", rows(9, 1), rows(3, 1, 1)) == {"x": ([9], 2), "y": ([3], 0)}
    assert stream.missed == 2


def test_a_reader_that_rests_has_all_of_many_small_frames_and_of_large_ones_the_newest(stream, monkeypatch):
    for row in range(5000):
        comes(stream, f"{row // 50}", rows(row % 50, 1))
    assert sum(len(stream.read(0)["x"]) for _ in range(5000)) == 5000
    assert (stream.read(0), stream.missed) == (None, 0)
    monkeypatch.setattr(arrays, "MAX_BACKLOG_BYTES", 3 * (24 * 100 + 400))
    for row in range(0, 1000, 100):
        comes(stream, "99", rows(50 + row, 100))
    read = [stream.read(0)["x"].values[0] for _ in range(3)]
    assert (read, stream.read(0), stream.missed) == ([750, 850, 950], None, 700)


def test_runs_that_a_reader_lets_go_of_as_a_whole_are_counted(stream, monkeypatch):
    came(stream, "a", rows(0, 10), rows(0, 10, 1))
    monkeypatch.setattr(arrays, "MAX_BACKLOG_BYTES", 2 * (24 * 200 + 400))
    comes(stream, "a", rows(15, 100), rows(10, 100, 1))
    comes(stream, "b", rows(0, 100), rows(0, 100, 1))
    comes(stream, "c", rows(0, 100), rows(0, 100, 1))
    comes(stream, "d", rows(3, 100), rows(0, 100, 1))
    assert stream.missed == (5 + 100 + 100) + (100 + 100)
    found = [{name: (len(some), some.missed) for name, some in stream.read(0).items()} for _ in range(2)]
    assert found == [{"x": (100, 205), "y": (100, 200)}, {"x": (100, 3), "y": (100, 0)}]
    assert (stream.read(0), stream.missed) == (None, 408)


def test_rows_that_came_before_are_left_out(stream):
    came(stream, "a", rows(5, 2))
    assert came(stream, "a", rows(4, 5)) == {"x": ([7, 8], 0)}
    assert came(stream, "a", rows(6, 3)) is None
    assert came(stream, "a", rows(9, 1)) == {"x": ([9], 0)}
    assert stream.missed == 0


def test_of_another_run_what_is_missing_from_its_first_row_on_is_counted_once(stream):
    came(stream, "a", rows(5, 2), rows(5, 2, 1))
    assert came(stream, "b", rows(3, 1)) == {"x": ([3], 3)}
    assert came(stream, "b", rows(4, 1), rows(2, 1, 1)) == {"x": ([4], 0), "y": ([2], 2)}
    assert came(stream, "c", rows(0, 1)) == {"x": ([0], 0)}
    assert came(stream, "d", rows(1, 1), rows(7, 1, 1)) == {"x": ([1], 1), "y": ([7], 0)}, "of c there was no y"
    assert stream.missed == 6


def test_of_a_name_with_two_groups_each_goes_on_where_it_was(stream):
    entries = [SampledEntry("", "<i8", 16, False)]
    names = [SampledName("x", at, 1, (), entries) for at in range(2)]
    stream.accept(StreamOpened("a-1", 0, names, {}))
    came(stream, "a", rows(9, 4, 1))  # the first buffer was full before
    assert stream.request.rows == {"x": [-1, 13]}


def test_it_asks_to_go_on_behind_what_was_read_or_behind_the_run_in_which_it_was_opened(stream):
    assert (stream.request.run, stream.request.rows) == ("", {})
    stream.accept(StreamOpened("a-1", 1, [], {}, "-"))
    stream.accept(StreamOpened("a-1", 2, [], {}, "z"))
    assert (stream.request.run, stream.request.rows) == ("-", {})
    came(stream, "a", rows(5, 2), rows(2, 1, 1))
    assert (stream.request.run, stream.request.rows) == ("a", {"x": [7], "y": [3]})


def connects_anew(stream):
    """Its session is lost, and another one, to another helper process, takes its place."""
    stream.detach()
    session = SimpleNamespace(declare_subscriber=lambda key, take: SimpleNamespace(undeclare=lambda: None))
    stream.attach(session, Root("robot", "bot", "1f"), SimpleNamespace(id="b", proof=""))


def test_what_came_before_a_link_was_lost_is_read_behind_it_as_it_was_then(stream):
    comes(stream, "a", rows(0, 4), rows(0, 4, 1))
    assert list(stream.read(0)["x"].values) == [0, 1, 2, 3]
    comes(stream, "a", rows(4, 3))
    comes(stream, "a", rows(4, 2, 1))
    connects_anew(stream)
    comes(stream, "b", rows(0, 2))
    assert list(stream.read(0)["x"].values) == [4, 5, 6]
    assert list(stream.read(0)["y"].values) == [4, 5]
    assert stream.read(0) is None  # how to read the others is not known yet
    assert stream.request.run == "a"
    entries = [SampledEntry("", "<i8", 16, False)]
    stream.accept(StreamOpened("b-1", 0, [SampledName(name, at, 1, (), entries) for at, name in enumerate("yx")], {}))
    assert list(stream.read(0)["y"].values) == [0, 1]
    assert (stream.read(0), stream.missed) == (None, 0)


def test_runs_whose_tables_came_and_went_before_it_asked_how_to_read_them_are_read(stream):
    came(stream, "a", rows(0, 4))
    for generation, run in enumerate("bcd", 1):
        comes(stream, run, rows(0, 3), generation=generation)
    assert stream.read(0) is None
    assert stream.request.known == 0
    entries = [SampledEntry("", "<i8", 16, False)]
    told = [StreamOpened("a-1", number, [SampledName("x", 0, number, (), entries)], {}) for number in (1, 2, 3)]
    earlier = [StreamLayout(one.generation, one.names) for one in told[:-1]]
    stream.accept(msgspec.structs.replace(told[-1], earlier=earlier))
    assert [(one.run, one["x"].divider, len(one["x"])) for one in (stream.read(0) for _ in range(3))] == [
        ("b", 1, 3), ("c", 2, 3), ("d", 3, 3),
    ]  # fmt: skip
    assert (stream.read(0), stream.missed) == (None, 0)


def test_what_is_lost_at_the_end_of_a_run_and_runs_of_which_nothing_came_are_counted(stream):
    comes(stream, "a", rows(5, 4), rows(0, 2, 1), earlier=20)
    comes(stream, "a", rows(9, 2), earlier=20)  # of its last frame nothing comes: 3 rows of x, and 1 of y
    comes(stream, "c", rows(0, 3), earlier=20 + 12 + 7)  # nor of b, with 7
    comes(stream, "c", rows(5, 1), earlier=39)
    comes(stream, "d", rows(1, 1), earlier=39 + 6)
    assert [stream.read(0).run for _ in range(5)] == ["a", "a", "c", "c", "d"]
    assert stream.missed == 4 + 7 + 2 + 1


def test_a_run_that_nobody_tells_any_more_how_to_read_is_counted(stream):
    comes(stream, "a", rows(0, 4), earlier=0)
    comes(stream, "b", rows(0, 3), rows(0, 2, 1), generation=1, earlier=4)
    comes(stream, "c", rows(0, 3), generation=2, earlier=9)
    comes(stream, "c", rows(3, 3), generation=3, earlier=9)
    assert stream.read(0).run == "a"
    assert stream.read(0) is None
    entries = [SampledEntry("", "<i8", 16, False)]
    stream.accept(StreamOpened("a-1", 3, [SampledName("x", 0, 1, (), entries)], {}))
    assert list(stream.read(0)["x"].values) == [3, 4, 5]
    assert stream.missed == 5 + 3


def test_another_helper_process_counts_anew(stream):
    comes(stream, "a", rows(0, 4), earlier=500)
    stream.read(0)
    connects_anew(stream)
    entries = [SampledEntry("", "<i8", 16, False)]
    stream.accept(StreamOpened("b-1", 0, [SampledName("x", 0, 1, (), entries)], {}))
    comes(stream, "a", rows(4, 2), earlier=0)
    comes(stream, "b", rows(0, 2), earlier=2)
    assert [stream.read(0).run for _ in range(2)] == ["a", "b"]
    assert stream.missed == 0


def test_a_frame_that_nobody_tells_any_more_how_to_read_is_missed(stream):
    came(stream, "a", rows(0, 4))
    data = msgspec.msgpack.encode(StreamFrame(7, "a", [rows(4, 3)]))  # of a table that was never told
    stream._take(SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: data)))
    connects_anew(stream)
    entries = [SampledEntry("", "<i8", 16, False)]
    stream.accept(StreamOpened("b-1", 0, [SampledName("x", 0, 1, (), entries)], {}))
    assert came(stream, "a", rows(9, 1)) == {"x": ([9], 5)}
    assert stream.missed == 5


def test_what_came_and_went_while_it_had_no_stream_is_counted_unless_some_of_it_is_to_be_read_yet(stream):
    opened = StreamOpened("a-1", 0, stream._opened[0], {}, missed=7)
    came(stream, "a", rows(0, 10))
    stream.accept(opened)
    assert stream.missed == 7
    comes(stream, "b", rows(0, 3))
    stream.accept(opened)
    assert stream.missed == 7
