"""What the frames of a stream hold: a stream begins with what comes, and leaves nothing out from then on."""

from dataclasses import replace

import msgspec

from silo.history.requests import OpenStream, StreamFrame
from silo.live import streams
from silo.live.feeds import Round
from silo.live.streams import ServedStream
from silo.logger.serving.answers import robot_state
from silo.segment.reader import SegmentReader
from silo.state.replica import Replica


def test_a_stream_goes_on_as_the_table_changes_and_has_a_new_run_from_its_first_row_on(new_logger, monkeypatch):
    log = new_logger("bot", frequency=100)
    log.array("x")
    stream = ServedStream(OpenStream(stream="a-1", names=["/log/x", "/log/gone"]), None, 0.0)

    def came(ticks, generation):
        for _ in range(ticks):
            log.collect()
        now, reader = (
            replace(Replica(robot_state(log, "", -1)).now, generation=generation),
            SegmentReader(log._present.path),
        )
        stream.adopt(now, reader)
        data, more = stream.frame(Round(now, reader, 0.0, 100.0, 0.0))
        rows = msgspec.msgpack.decode(data, type=StreamFrame).rows if data else []
        return [(one.first, one.count) for one in rows], more

    log.start()
    assert came(3, 1) == ([], False)
    assert came(2, 1) == ([(3, 2)], False)
    assert came(2, 2) == ([(5, 2)], False)
    log.restart()
    assert came(4, 2) == ([(0, 4)], False)
    assert came(0, 2) == ([], False)
    # clients read all of it by the same words
    assert (stream.opened.generation, stream.opened.missing) == (0, {"/log/gone": "it is no longer in the table"})
    monkeypatch.setattr(streams, "MAX_FRAME_BYTES", 2 * 24 + 1)
    assert came(3, 2) == ([(4, 2)], True)
    assert came(0, 2) == ([(6, 1)], False)
