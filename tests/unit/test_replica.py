"""The helper's copy of the logger: told by any thread while the main thread replaces what it tells of."""

import os
import threading

import msgspec

from silo.logger.serving.answers import robot_state
from silo.state.replica import Replica


class TakenOver:
    """A lock after which the main thread takes over the next run at once, and closes the reader of this one."""

    def __init__(self, replica: Replica) -> None:
        self.replica, self.lock = replica, threading.Lock()

    def __enter__(self) -> None:
        self.lock.acquire()

    def __exit__(self, *_: object) -> None:
        self.lock.release()
        os.close(self.replica._reader.fileno())


def test_a_status_is_told_while_its_run_is_replaced(new_logger) -> None:
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    log.collect()
    replica = Replica(robot_state(log, "", -1))
    size = replica.status().segment_bytes
    reader = replica._reader
    spare = os.dup(reader.fileno())
    replica._lock = TakenOver(replica)
    found = replica.status()
    os.dup2(spare, reader.fileno())  # its own close comes later
    os.close(spare)
    assert found.segment_bytes == size > 0
    assert found.ticks == 1


def test_a_generation_is_of_one_table_one_set_of_derived_signals_and_one_run(new_logger) -> None:
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.update(read_script=False)
    replica = Replica(robot_state(log, "", -1))

    def generation(sent: int) -> int:
        replica.take(robot_state(log, "", sent))
        return replica.now.generation

    revision = log._scripted.revision
    first = generation(revision)
    assert generation(revision) == first  # as each status is: nothing that was made for it is out of date
    log.set("x", divider=2)
    edited = generation(revision)
    assert edited > first
    log.start()
    started = generation(log._scripted.revision)
    assert started > edited
    log.collect()
    assert generation(log._scripted.revision) == started
    log.derive("twice", "2 * x")
    assert generation(log._scripted.revision) > started


def test_what_was_cut_off_and_stands_in_no_file_is_unsaved(new_logger) -> None:
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    log.collect()
    state = robot_state(log, "", -1)
    replica = Replica(state)
    assert not replica.status().saved
    replica.mark_saved(log._present.path, 1)
    assert replica.status().saved
    replica.take(msgspec.structs.replace(state, table=None, cut_off=3))
    assert not replica.status().saved
    log.collect()
    replica.take(msgspec.structs.replace(state, table=None))
    assert not replica.status().saved


def test_a_status_says_of_which_part_of_a_run_a_save_would_be(new_logger, tmp_path) -> None:
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    parts = []
    for divider in (2, 3, 4):
        log.collect()
        parts.append((Replica(robot_state(log, "", -1)).status().part, log.save(name=f"by{divider}")[-1].path))
        log.set("x", divider=divider, cut=True)
    assert parts == [
        (0, str(tmp_path / "by2.silo")), (2, str(tmp_path / "by3_part2.silo")), (3, str(tmp_path / "by4_part3.silo")),
    ]  # fmt: skip
