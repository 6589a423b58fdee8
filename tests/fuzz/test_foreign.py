"""Bytes of anybody under a robot's keys: whatever they are, who listens leaves them out, or is told in words.

2,000 of each kind; `SILO_FUZZ=100000` takes so many. The number of one that failed makes it again.
"""

import logging
import os
import random
from collections import deque
from collections.abc import Callable

import msgspec
import numpy as np
import pytest

from silo.core.elements import State
from silo.errors import ConnectionLostError, SiloError
from silo.fleet.exchange import decode_reply
from silo.history.arrays import Gathering, Stream
from silo.history.requests import (
    Columns,
    OpenStream,
    SampledEntry,
    SampledName,
    SampledRows,
    SampleRows,
    StreamFrame,
    StreamOpened,
)
from silo.history.search_arrays import found_of
from silo.history.search_requests import FoundIn, MomentsFound
from silo.live.requests import OpenView, ViewOpened
from silo.live.topic import batch_of
from silo.live.view import View, history_columns
from silo.rpc.foreign import MOST, Foreign
from silo.rpc.published import Event, EventKind, NotLive, ViewFrame

COUNT = int(os.environ.get("SILO_FUZZ", "2000"))
_encoder = msgspec.msgpack.Encoder()
WILD = (
    0, 1, -1, 7, 2**31, 2**53, 2**63 - 1, -(2**63), 2**64 - 1, 1e308, float("nan"), -0.5, "", "\x1b[2J", "ä" * 300,
    None, True, [], {}, b"", b"\x00" * 7, "|O", "<f8", "<U0", "(2,3)f4", [[]], {"a": [1]}, {-5: 1}, {2**62: "x"},
)  # fmt: skip
ENCODED = (
    "silo/samples", "dtype=<f8", "dtype=|O", "dtype=(2,3)f4", "shape=3", "shape=-1", "shape=0,0", "shape=9" * 9,
    "fields=_x:<f8,_n:<i4", "fields=_x:|O", "fields=:", "fields=", "dtype={", "dtype=,", "dtype=V0", "x=1", "",
    "attached",
)  # fmt: skip


class Payload:
    def __init__(self, data: bytes) -> None:
        self.to_bytes = lambda: data


class Came:
    """A sample as a subscriber hands it out."""

    def __init__(self, data: bytes, key: str = "silo/robot3~3f/anymal/view/a-0") -> None:
        self.payload, self.key_expr = Payload(data), key


class Heard:
    """A subscription to which came what is put into it."""

    def __init__(self) -> None:
        self.samples: deque[Came] = deque()

    def try_recv(self) -> Came | None:
        return self.samples.popleft() if self.samples else None


def frame(number: int = 1) -> ViewFrame:
    cells = np.zeros((1, 4))
    return ViewFrame(
        number, 3, 10**18, 5, State.RUNNING, 100.0, 0, np.zeros(1, "<i8").tobytes(), np.zeros(1, "<i8").tobytes(),
        np.zeros(2).tobytes(), {0: "text"}, 100, 4, cells.tobytes(), cells.tobytes(), bytes(4), {0: 7}, 0, {0: 5},
        {0: 1}, {0: NotLive.FULL},
    )  # fmt: skip


NAME = SampledName("/log/x", 0, 1, (2,), [SampledEntry("", "<f8", 16), SampledEntry("", "<f8", 24)])
ROWS = SampledRows(0, 5, 3, bytes(3 * 32))
STREAMED = StreamFrame(1, "run", [ROWS])
COLUMNS = Columns(["/log/x"], 10, 4, 10**9, bytes(32), bytes(32))
FOUND = MomentsFound("run", [FoundIn("/log/x", 2, 0, np.arange(2).tobytes(), np.zeros(2).tobytes(), "<f8", 0, 1)])
EVENT = Event(1, 10**18, EventKind.STARTED, "started", "alice")


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Bytes that were a message: some changed, cut, doubled, or a value in it of another kind and size."""
    how = chance.randrange(5)
    if how == 0:
        return chance.randbytes(chance.randrange(200))
    if how == 1:
        return data[: chance.randrange(len(data) + 1)]
    if how == 2:
        at = chance.randrange(len(data))
        return data[:at] + chance.randbytes(chance.randrange(1, 9)) + data[at + chance.randrange(9) :]
    told = msgspec.msgpack.decode(data, strict=False)
    _change(told, chance)
    try:
        return _encoder.encode(told)
    except (OverflowError, TypeError):
        return data


def _change(told: object, chance: random.Random) -> None:
    while isinstance(told, dict | list) and told:
        place = chance.choice(list(told) if isinstance(told, dict) else range(len(told)))
        if not isinstance(told[place], dict | list) or chance.random() < 0.3:
            told[place] = chance.choice(WILD)
            return
        told = told[place]


def opened_view(heard: Heard) -> View:
    view = View(OpenView(view="a-0", values=["/log/x"], plots=["/log/x"], rate_hz=10), 0, lambda: None, lambda _: None)
    view._subscriber = heard
    view.accept(ViewOpened("a-0", 3, ["/log/x[0]", "/log/x[1]"], ["/log/x"], [], []))
    return view


def show(data: bytes) -> None:
    heard = Heard()
    view = opened_view(heard)
    heard.samples += [Came(_encoder.encode(frame(1))), Came(data), Came(_encoder.encode(frame(3)))]
    shown = view.frame()
    assert shown is not None
    assert shown.newest.shape == (2,)
    assert shown.low.shape == shown.high.shape


def stream(data: bytes) -> None:
    made = Stream(OpenStream(stream="a-0", names=["/log/x"]), 0, lambda: None, lambda _: None)
    made.accept(StreamOpened("a-0", 1, [NAME], {}))
    for one in (_encoder.encode(STREAMED), data, _encoder.encode(STREAMED)):
        made._take(Came(one))
    while (batch := made.read(0.0)) is not None:
        for name in batch:
            assert len(batch[name].values) == len(batch[name].ticks)


def gather(data: bytes) -> None:
    gathering = Gathering(["/log/x"])
    if isinstance(reply := decode_reply(data, "robot3/anymal"), SampleRows):
        gathering.take(reply)
        gathering.samples()


def history(data: bytes) -> None:
    if isinstance(reply := decode_reply(data, "robot3/anymal"), Columns):
        history_columns(reply)


def moments(data: bytes) -> None:
    if isinstance(reply := decode_reply(data, "robot3/anymal"), MomentsFound):
        found_of(reply)


KINDS: dict[str, tuple[Callable[[bytes], object], bytes]] = {
    "frames": (show, _encoder.encode(frame(2))),
    "streams": (stream, _encoder.encode(STREAMED)),
    "replies": (lambda data: decode_reply(data, "robot3/anymal"), _encoder.encode(FOUND)),
    "samples": (gather, _encoder.encode(SampleRows("run", [ROWS], [(5, 8)], [NAME]))),
    "histories": (history, _encoder.encode(COLUMNS)),
    "moments": (moments, _encoder.encode(FOUND)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_comes_is_left_out_or_told_in_words(kind, caplog) -> None:
    caplog.set_level(logging.CRITICAL)
    take, whole = KINDS[kind]
    take(whole)
    for number in range(COUNT):
        data = damaged(whole, random.Random(number))
        try:
            take(data)
        except SiloError:
            continue
        except Exception as error:
            raise AssertionError(f"{kind} number {number}: {data!r}") from error


def test_topics_in_any_encoding_are_batches_or_words() -> None:
    for number in range(COUNT):
        chance = random.Random(number)
        encoding = ";".join(chance.choice(ENCODED) for _ in range(chance.randrange(1, 4)))
        data = chance.randbytes(chance.randrange(100))
        behind = chance.choice([b"", chance.randbytes(4), encoding.replace("attached", "dtype=<f8").encode()])
        try:
            batch = batch_of(data, encoding, chance.randbytes(chance.randrange(9)) + behind)
        except SiloError:
            continue
        except Exception as error:
            raise AssertionError(f"number {number}: {encoding!r} {data!r}") from error
        assert len(batch.time_ns) == len(batch.values)


def test_what_is_left_out_is_told_once_and_too_many_in_a_row_are_another_silo(caplog) -> None:
    foreign = Foreign("a frame")
    for _ in range(MOST - 1):
        assert foreign.read("silo/robot3/x/view/a", lambda: int("no")) is None
    with pytest.raises(ConnectionLostError, match="install the same version of silo"):
        assert foreign.read("silo/robot3/x/view/a", lambda: int("no")) is None
    assert foreign.read("silo/robot3/x/view/a", lambda: 1) == 1
    assert foreign.read("silo/robot3/x/view/a", lambda: int("no")) is None
    assert foreign.count == MOST + 1
    assert len(caplog.records) == 1
    assert caplog.records[0].exc_info is None


def test_a_frame_of_somebody_else_hides_none_of_the_robots() -> None:
    heard = Heard()
    view = opened_view(heard)
    heard.samples += [Came(b"\x01"), Came(_encoder.encode(frame(1))), Came(b"\x01")]
    shown = view.frame()
    assert shown is not None
    assert shown.tick == 5
