"""Segments of older silos stay readable. `tests/data/layout_1.segment.gz` is of by one that was killed at tick 50."""

import gzip
import zlib
from pathlib import Path

import msgspec
import numpy as np
import pytest

import silo
from silo.core.recording import NO_FAILURES
from silo.errors import SegmentError
from silo.journal.format import Head
from silo.journal.reader import JournalReader
from silo.journal.writer import Disk, JournalWriter
from silo.segment.layout import LAYOUT_VERSION, HeaderWord
from silo.segment.reader import SegmentReader

LAYOUT_1 = Path(__file__).parents[1] / "data" / "layout_1.segment.gz"
KEPT = {
    "/log/joints/q": np.array([[k, k / 2, -k] for k in range(30, 50)], float),
    "/log/n": np.arange(0, 10, 2)[:, None],
    "/log/g": np.array([[k * 0.1, k * 0.2] for k in range(50)], np.float32),
    "/log/mode": np.arange(50)[:, None] % 2,
    "/log/temperature": 20 + np.arange(0, 50, 3)[:, None],
}


@pytest.fixture
def layout_1(tmp_path):
    path = tmp_path / "robot.1.0.segment"
    path.write_bytes(gzip.decompress(LAYOUT_1.read_bytes()))
    return path


def test_every_value_of_the_first_layout_is_read(layout_1):
    reader = SegmentReader(layout_1)
    assert reader.running
    recording = reader.snapshot()
    found = {e.name: np.stack([entry.values for entry in e.entries], axis=1) for e in recording.elements}
    assert found.keys() == KEPT.keys()
    for name, values in KEPT.items():
        assert np.array_equal(found[name], values), name
    stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(1, 51)
    assert recording.time_ns.tolist() == stamps.tolist()
    assert (recording.logger, recording.offset, recording.warnings) == ("robot", 50, ())


def test_the_first_layout_told_of_no_failures(layout_1):
    assert {element.failures for element in SegmentReader(layout_1).snapshot().elements} == {NO_FAILURES}


def test_a_layout_of_the_future_is_refused_with_what_to_do(layout_1):
    data = bytearray(layout_1.read_bytes())
    data[8 * HeaderWord.VERSION] = LAYOUT_VERSION + 1
    layout_1.write_bytes(data)
    with pytest.raises(
        SegmentError, match=r"written by a newer silo \(layout 3, this silo reads 1 to 2\): update silo"
    ):
        SegmentReader(layout_1)


def add_beside_every_field(part) -> int:
    """Give every map of a description a field that this silo doesn't know; returns how many got one."""
    if isinstance(part, list):
        return sum(map(add_beside_every_field, part))
    if not isinstance(part, dict):
        return 0
    # what a program says of itself is words by names of its own: no fields
    count = sum(add_beside_every_field(each) for name, each in part.items() if name != "about")
    if all(not key.lstrip("-").isdecimal() for key in part):  # not the labels of an enumeration
        part["novelties"] = {"when": "x > 2", "pre_s": 1.5, "marks": [None, {"tick": 7}]}
        count += 1
    return count


def test_a_journal_passes_over_fields_that_a_newer_silo_adds(new_logger, tmp_path):
    logger = new_logger()
    x = logger.array("x", 2)
    logger.start()
    reader = SegmentReader(logger._present.path)
    journal = tmp_path / "run.journal"
    writer = JournalWriter(journal, Head(logger._present.path, reader.schema), Disk())
    head = msgspec.json.decode(msgspec.json.encode(Head(logger._present.path, reader.schema)))
    assert add_beside_every_field(head) >= 12
    body = msgspec.json.encode(head)
    facts = len(body).to_bytes(8, "little") + zlib.crc32(body).to_bytes(8, "little")
    (journal / "schema").write_bytes(facts + body)
    x[:] = 3, 4
    logger.collect()
    writer.append(reader)
    writer.close()
    (element,) = JournalReader(journal).snapshot().elements
    assert [entry.values.tolist() for entry in element.entries] == [[3.0], [4.0]]


def described_anew(new_logger, change) -> Path:
    """A segment of a tick, whose description was changed."""
    logger = new_logger()
    x = logger.array("x", 2, buffer=silo.BufferType.GROWING)
    logger.start()
    x[:] = 3, 4
    logger.collect()
    path = Path(logger._present.path)
    data = bytearray(path.read_bytes())
    words = np.frombuffer(data, np.int64)
    begin, size = int(words[HeaderWord.SCHEMA_OFFSET]), int(words[HeaderWord.SCHEMA_BYTES])
    schema = msgspec.json.decode(bytes(data[begin : begin + size]))
    change(schema)
    body = msgspec.json.encode(schema)
    words[HeaderWord.SCHEMA_OFFSET], words[HeaderWord.SCHEMA_BYTES] = len(data), len(body)  # there it has room
    data = bytes(data) + body
    copy = path.with_name("newer.segment")
    copy.write_bytes(data)
    return copy


def test_fields_that_a_newer_silo_adds_to_the_description_are_passed_over(new_logger):
    def newer(schema):
        schema["novel"] = [{"of": "x"}]
        assert add_beside_every_field(schema) >= 11

    (element,) = SegmentReader(described_anew(new_logger, newer)).snapshot().elements
    assert [entry.values.tolist() for entry in element.entries] == [[3.0], [4.0]]


@pytest.mark.parametrize(("change", "says"), [
    (lambda of: of.update(chunk_bytes=of["chunk_bytes"] + 4), "don't fit its chunks"),
    (lambda of: of.update(chunk_bytes=8), "don't fit its chunks"),
    (lambda of: of["rings"][1].update(capacity=0), "ring 1 of its description makes no sense"),
    (lambda of: of["rings"][1].update(offset=4), "ring 1 of its description makes no sense"),
    (lambda of: of["rings"].clear(), "there is no ring of time stamps"),
    (lambda of: of.update(logger="a/b"), "is no name"),
])  # fmt: skip
def test_a_description_that_does_not_fit_itself_is_refused(new_logger, change, says):
    with pytest.raises(SegmentError, match=says):
        SegmentReader(described_anew(new_logger, change))


def test_every_run_has_an_identity_of_its_own(new_logger):
    logger = new_logger()
    logger.array("x")
    found = []
    for _ in range(3):
        logger.start()
        logger.collect()
        found.append(SegmentReader(logger._present.path).schema)
        logger.stop()
    assert len({schema.run for schema in found}) == 3
    assert len({schema.logger_id for schema in found}) == 1
    assert found[0].logger_id != ""
