"""The helper's copy of the logger: told by any thread while the main thread replaces what it tells of."""

import os
import threading

from silo.logger.helper.answers import robot_state
from silo.state.replica import Replica


class TakenOver:
    """A lock after which the main thread takes over the next run at once, and closes the reader of this one."""

    def __init__(self, mirror: Replica) -> None:
        self.mirror, self.lock = mirror, threading.Lock()

    def __enter__(self) -> None:
        self.lock.acquire()

    def __exit__(self, *_: object) -> None:
        self.lock.release()
        os.close(self.mirror._reader.fileno())


def test_a_status_is_told_while_its_run_is_replaced(new_logger) -> None:
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    log.collect()
    mirror = Replica(robot_state(log, "", -1))
    size = mirror.status().segment_bytes
    reader = mirror._reader
    spare = os.dup(reader.fileno())
    mirror._lock = TakenOver(mirror)
    found = mirror.status()
    os.dup2(spare, reader.fileno())  # its own close comes later
    os.close(spare)
    assert found.segment_bytes == size > 0
    assert found.ticks == 1
