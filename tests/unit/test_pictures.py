"""Elements of very many values: nothing is done for each of them where it need not be, and they are as any other."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import silo
from silo.bridges.messages import Block, live_topics
from silo.history import arrays
from silo.history.arrays import SampleArrays, Stream
from silo.history.requests import OpenStream, SampledEntry, SampledName, SampledRows, StreamFrame, StreamOpened
from silo.loop import plan, types
from tests.stand_ins.ticking import Robot


def test_the_values_of_a_picture_are_named_once(tmp_path, monkeypatch):
    calls = []

    def counted(*given):
        calls.append(given)
        return expand(*given)

    expand = types.expand
    for module in (types, plan):
        monkeypatch.setattr(module, "expand", counted)
    picture = np.arange(60 * 80 * 3, dtype=np.uint16).reshape(60, 80, 3)
    with silo.Logger("eye", folder=tmp_path) as log:
        log.add(picture, "picture")
        log.start()
        log.collect()
        assert len(calls) == 1
        assert (silo.Log(log.snapshot())["picture"].values[0] == picture).all()


@pytest.mark.parametrize(
    ("value", "blocks"),
    [
        (np.arange(60, dtype=np.uint8).reshape(5, 4, 3), 1), (np.arange(6.0).reshape(2, 3), 1),
        (np.array([True, False]), 1), (np.array([1 + 2j, 3 - 4j]), 1), (np.array([1, np.nan], np.float16), 1),
        (np.array([1.5, 2.5], np.longdouble), 1), (np.array(["2026-11-30", "NaT"], "M8[ns]"), 1), (np.array(7), 1),
        (np.array((1.0, 2), [("a", "f8"), ("b", "i4")]), 2), (np.array((1.0, 2.0), [("a", "f8"), ("b", "f8")]), 1),
        ({"kind": "quaternion_wxyz", "source": np.array([1.0, 0.5, 0.25, 0.125])}, 2),
    ],
)  # fmt: skip
def test_messages_of_an_array_are_filled_at_once_and_are_those_that_are_filled_value_by_value(tmp_path, value, blocks):
    with silo.Logger("eye", folder=tmp_path) as log:
        given = value if isinstance(value, dict) else {"source": value}
        log.add(**given, name="value")
        log.update()
        ((topic,), _) = live_topics(log.elements)
    assert len(topic.blocks) == blocks
    samples = SampleArrays(np.arange(3), np.arange(3) * 10**9 + 5, np.stack([given["source"]] * 3))
    single = replace(topic, blocks=tuple(map(Block, topic.channel.parts)))
    filled = []
    for one in (topic, single):
        messages = one.empty(samples)
        one.fill(messages, samples)
        filled.append(messages.tobytes())
    assert filled[0] == filled[1]


def test_how_rows_of_a_stream_are_read_is_found_out_once(monkeypatch):
    made = []
    packer = arrays.Packer
    monkeypatch.setattr(arrays, "Packer", lambda *given: made.append(given) or packer(*given))
    entries = [SampledEntry(f"_{at}", "<f8", 16 + 8 * at) for at in range(4)]
    opened = StreamOpened("stream", 1, [SampledName("/log/x", 0, 1, (2, 2), entries)], {}, "run")
    stream = Stream(OpenStream("stream", ["/log/x"]), 0, lambda: None, lambda _: None)
    for number in range(3):
        stream.accept(msgspec.msgpack.decode(msgspec.msgpack.encode(opened), type=StreamOpened))  # as it is renewed
        rows = np.concatenate([np.array([number, number], "<i8"), np.full(4, number, "<f8").view("<i8")])
        frame = StreamFrame(1, "run", [SampledRows(0, number, 1, rows.tobytes())])
        stream._take(Robot(payload=Robot(to_bytes=lambda frame=frame: msgspec.msgpack.encode(frame))))
        assert stream.read(0.0)["/log/x"].values.tolist() == [[[number] * 2] * 2]
    assert len(made) == 1
