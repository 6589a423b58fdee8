"""A topic asks why nothing comes once nothing has come for long, and never else."""

import asyncio

import pytest

from silo.errors import ElementError
from silo.live.topic import Topic

LATE, EARLY = -1.0, 60.0


class Scripted(Topic):
    """A topic to which these batches come, until it is closed."""

    def __init__(self, batches, why):
        super().__init__("/log/x", lambda topic: None, self._why)
        self.left, self.asked, self.why = list(batches), 0, why

    def _why(self):
        self.asked += 1
        return self.why

    def _take(self):
        if not self.left:
            self.close()
            return []
        return self.left.pop(0)

    def all(self, way):
        async def gathered():
            return [batch async for batch in self]

        return list(self) if way == "plain" else asyncio.run(gathered())


@pytest.mark.parametrize("way", ["plain", "asyncio"])
@pytest.mark.parametrize(("silence_s", "asked"), [(LATE, 2), (EARLY, 0)])
def test_why_is_asked_where_nothing_came_for_long(way, silence_s, asked, monkeypatch):
    monkeypatch.setattr("silo.live.topic.SILENCE_S", silence_s)
    topic = Scripted([["a", "b"], [], ["c"], [], ["d"]], why="")
    assert topic.all(way) == ["a", "b", "c", "d"]
    assert topic.asked == asked


@pytest.mark.parametrize("way", ["plain", "asyncio"])
def test_a_topic_ends_with_why_nothing_will_come(way, monkeypatch):
    monkeypatch.setattr("silo.live.topic.SILENCE_S", LATE)
    topic = Scripted([["a"], [], ["b"]], why="it is off")
    with pytest.raises(ElementError, match="it is off"):
        topic.all(way)
    assert topic.left == [["b"]]


def read_by(topic, way):
    return topic.read() if way == "plain" else asyncio.run(topic.read_async(0.0))


@pytest.mark.parametrize("way", ["plain", "asyncio"])
def test_a_read_says_too_why_nothing_will_come_once_nothing_came_for_long(way, monkeypatch):
    topic = Scripted([[], [], ["a"], []], why="it is off")
    assert read_by(topic, way) == []
    assert topic.asked == 0, "a read in a loop doesn't ask each time"
    monkeypatch.setattr("silo.live.topic.SILENCE_S", LATE)
    with pytest.raises(ElementError, match="it is off"):
        read_by(topic, way)
    assert read_by(topic, way) == ["a"]
    topic.why = ""
    assert (read_by(topic, way), topic.asked) == ([], 2)
