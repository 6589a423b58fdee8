"""What a viewer of Foxglove is sent: the size of a payload in the fewest bytes (RFC 6455, 5.2), and what got lost."""

from types import SimpleNamespace

import pytest

protocol = pytest.importorskip("silo.bridges.foxglove.protocol", exc_type=ImportError)


@pytest.mark.parametrize(
    ("size", "told"),
    [
        (0, [0]),
        (125, [125]),
        (126, [126, 0, 126]),
        (65_535, [126, 255, 255]),
        (65_536, [127, 0, 0, 0, 0, 0, 1, 0, 0]),
        (2**32, [127, 0, 0, 0, 1, 0, 0, 0, 0]),
    ],
)
def test_a_size_is_told_in_the_fewest_bytes(size, told):
    assert list(protocol.frame_head(size)) == [0x82, *told]


@pytest.mark.parametrize("missed", [0, 1, 3])
def test_samples_that_were_lost_before_the_bridge_are_told_to_who_has_their_topic(missed, monkeypatch):
    server = pytest.importorskip("silo.bridges.foxglove.server", exc_type=ImportError)
    monkeypatch.setattr(server, "Frames", lambda topic, samples: (topic, samples))
    had = []
    viewer = SimpleNamespace(
        send=lambda frames, number: had.append((*frames, number)),
        tell=lambda level, text: had.append((level.name, text)),
    )
    topic = SimpleNamespace(channel=SimpleNamespace(topic="/bot/x"))
    samples, offer = SimpleNamespace(missed=missed), SimpleNamespace(topic=topic)
    server.ViewerServer._send(None, offer, samples, [(viewer, 7)])
    words = {1: "1 sample of /bot/x", 3: "3 samples of /bot/x"}
    told = [("WARNING", f"{words[missed]} lost on the way to the bridge")] if missed else []
    assert had == [(topic, samples, 7), *told]
