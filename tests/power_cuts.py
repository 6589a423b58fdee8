"""Power cuts of a journal, by record and replay: for the property tests and the long mode.

As SQLite is tested: every call to the system is recorded, and replayed up to each one. Of what was not synced by then,
any sector may have reached the disk, or not, or only as zeros or garbage; a name may be there or not.
"""

import contextlib
import random
import re
import shutil
from pathlib import Path

import msgspec
import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.core.recording import Recording
from silo.errors import SegmentError
from silo.files.formats import read_recording
from silo.helper.left_logs import recover
from silo.journal import writer as journal_writer
from silo.journal.format import Head
from silo.journal.reader import JournalReader
from silo.journal.writer import Disk, JournalWriter
from silo.logger.logger import Logger
from silo.recovery.journals import is_journal
from silo.segment.reader import SegmentReader

SECTOR = 512


class RecordingDisk(Disk):
    """Does what it is told, and notes it; `durable` notes the ticks that the writer announced at a step."""

    def __init__(self) -> None:
        self.calls: list[tuple] = []
        self.last_tick = 0  # of all that were logged
        self._paths: dict[int, Path] = {}
        self.refuse_after: int | None = None  # calls until the disk is full

    def _may(self) -> None:
        if self.refuse_after is not None:
            self.refuse_after -= 1
            if self.refuse_after < 0:
                raise OSError(28, "No space left on device")

    def make_folder(self, path):
        super().make_folder(path)
        self.calls.append(("folder", path))

    def create(self, path):
        descriptor = super().create(path)
        self._paths[descriptor] = path
        self.calls.append(("create", path))
        return descriptor

    def write(self, descriptor, data, offset):
        self._may()
        super().write(descriptor, data, offset)
        self.calls.append(("write", self._paths[descriptor], offset, bytes(data)))

    def truncate(self, descriptor, size_bytes):
        super().truncate(descriptor, size_bytes)
        self.calls.append(("truncate", self._paths[descriptor], size_bytes))

    def sync(self, descriptor):
        self._may()
        super().sync(descriptor)
        self.calls.append(("sync", self._paths[descriptor]))

    def sync_folder(self, path):
        super().sync_folder(path)
        self.calls.append(("sync_folder", path))

    def remove(self, path):
        super().remove(path)
        self.calls.append(("remove", path))

    def announce(self, ticks):
        self.calls.append(("durable", ticks))


class _File:
    """A file as the disk has it: what was synced, and the writes since."""

    def __init__(self) -> None:
        self.synced = b""
        self.pending: list[tuple[int, bytes]] = []
        self.named = False  # whether its name was synced
        self.removed = False

    def after_power_cut(self, chance: random.Random) -> bytes | None:
        """Its bytes when the power came back; None where there is no such file."""
        if (not self.named or self.removed) and chance.random() < 0.5:
            return None
        data = bytearray(self.synced)
        for offset, written in self.pending:
            end = offset + len(written)
            if chance.random() < 0.7 and end > len(data):
                data += bytes(end - len(data))  # the length may reach the disk before the data
            for begin in range(0, len(written), SECTOR):
                place = slice(offset + begin, min(offset + begin + SECTOR, end))
                if place.stop > len(data):
                    break
                fate = chance.random()
                if fate < 0.6:
                    data[place] = written[begin : begin + SECTOR]
                elif fate < 0.7:
                    data[place] = chance.randbytes(place.stop - place.start)
        return bytes(data)


def disk_after(calls: list[tuple], chance: random.Random) -> tuple[dict[Path, bytes], int]:
    """The files after a power cut behind these calls, and the ticks that were announced as durable."""
    files: dict[Path, _File] = {}
    durable = 0
    for name, *arguments in calls:
        if name == "create":
            files[arguments[0]] = _File()
        elif name == "write":
            files[arguments[0]].pending.append((arguments[1], arguments[2]))
        elif name == "truncate":
            file = files[arguments[0]]
            file.pending = [(at, data) for at, data in file.pending if at < arguments[1]]
        elif name == "sync":
            file = files[arguments[0]]
            whole = bytearray(file.synced)
            for offset, data in file.pending:
                whole += bytes(max(0, offset + len(data) - len(whole)))
                whole[offset : offset + len(data)] = data
            file.synced, file.pending = bytes(whole), []
        elif name == "sync_folder":
            for path, file in list(files.items()):
                if path.parent == arguments[0]:
                    file.named = True
                    if file.removed:
                        del files[path]
        elif name == "remove":
            files[arguments[0]].removed = True
        elif name == "durable":
            durable = arguments[0]
    found = {path: data for path, file in files.items() if (data := file.after_power_cut(chance)) is not None}
    return found, durable


def lay_out(files: dict[Path, bytes], journal: Path, target: Path) -> Path:
    """The files in a folder of their own."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    for path, data in files.items():
        (target / path.relative_to(journal)).write_bytes(data)
    return target


def check(recording: Recording, durable: int, options: list[tuple[int, BufferType, int]]) -> None:
    """Every value is that of its tick, nothing durable is missing."""
    ticks = recording.offset
    assert ticks >= durable
    first = ticks - len(recording.time_ns)
    assert recording.time_ns.tolist() == [1000 + tick for tick in range(first, ticks)]
    found = {element.name: element for element in recording.elements}
    for number, (divider, kind, size) in enumerate(options):
        due = -(-ticks // divider)
        if not due:
            continue
        element = found[f"/log/x{number}"]
        rows = np.stack([entry.values for entry in element.entries], axis=1)
        logged = (first + element.stamp_indices).astype(float)
        assert np.array_equal(rows, np.stack([logged, -logged, logged / 2], axis=1))
        expected = due if kind is BufferType.GROWING else min(due, size)
        assert element.count == min(expected, sum(1 for tick in range(first, ticks) if tick % divider == 0))


def logged_to_journal(folder: Path, options, batches, disk, refusals=(), block_bytes: int = 1 << 20) -> Path:
    """Run a logger and its journal for some batches of ticks; the journal is as one of another boot."""
    tick = [0]
    log = Logger("j", folder=folder, script=folder / "none.yaml", max_time=0, clock=lambda: 1000 + tick[0])
    arrays = [
        log.array(f"x{number}", 3, divider=divider, buffer=kind, size=size)
        for number, (divider, kind, size) in enumerate(options)
    ]
    with contextlib.closing(log), pytest.MonkeyPatch.context() as patched:
        log.start()
        reader = SegmentReader(log._present.path)
        schema = msgspec.structs.replace(reader.schema, boot_id="before the power cut")
        patched.setattr(journal_writer, "BLOCK_BYTES", block_bytes)
        writer = JournalWriter(folder / "run.journal", Head(str(reader.path), schema), disk)
        for number, ticks in enumerate(batches):
            for _ in range(ticks):
                for array in arrays:
                    array[:] = tick[0], -tick[0], tick[0] / 2
                log.collect()
                tick[0] += 1
            if number in refusals and reader.ticks > writer.durable_ticks:
                disk.refuse_after = refusals[number]
                with pytest.raises(OSError, match="No space left"):
                    writer.append(reader)
                disk.refuse_after = None
            else:
                disk.announce(writer.append(reader))
        writer.close()
        disk.last_tick = reader.ticks
    return folder / "run.journal"


def read_back(journal: Path, *, by_command: bool) -> Recording | None:
    """What a journal proves, None for one that proves nothing; `by_command` as `silo recover` saves it."""
    try:
        if not by_command:
            return JournalReader(journal).snapshot()
        files = recover(journal, journal.parent / "saved").files if is_journal(journal) else []
    except SegmentError:
        return None
    if not files:
        assert not journal.exists() or not is_journal(journal)
        return None
    recording = read_recording(files[0].path)
    assert not journal.exists()
    assert re.match(rf"its journal (was durable to tick|holds all) {recording.offset}\b", recording.warnings[0])
    return recording


def replay(folder: Path, options, batches, seed: int, *, refusals=(), commands: float = 0.0) -> int:
    """Cut the power behind every call of a run and look at what is read back; returns how many cuts that were.

    `commands` is the share of cuts that are recovered as by `silo recover`. Raises AssertionError for what is wrong.
    """
    disk, chance = RecordingDisk(), random.Random(seed)
    journal = logged_to_journal(folder, options, batches, disk, refusals, 700)
    for cut in range(len(disk.calls) + 1):
        files, durable = disk_after(disk.calls[:cut], chance)
        found = lay_out(files, journal, folder / "after")
        recording = read_back(found, by_command=chance.random() < commands)
        if recording is None:
            assert durable == 0
        else:
            check(recording, durable, options)
            if any("nothing is missing" in warning for warning in recording.warnings):
                assert recording.offset == disk.last_tick
    return len(disk.calls) + 1
