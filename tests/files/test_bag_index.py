"""Of a whole bag that silo wrote, each element is read when it is asked for, and nothing else is touched."""

import numpy as np
import pytest
from mcap.opcode import Opcode

import silo
from silo.core.recording import Recording, read_whole
from silo.errors import FileFormatError
from silo.files.bag_reader import open_bag
from silo.files.bags import channels
from silo.files.bags import index as bag_index
from silo.files.bags.index import ALONE, BagElements
from silo.files.bags.writer import write_bag
from silo.files.formats import read_recording
from silo.files.mcap.index import read_index, record_at
from tests.stand_ins.saved import element
from tests.whole_bags import read_bag

TICKS = 3000
NAMES = [f"/log/{name}" for name in ("position", "mode", "text", "slow", "force", "gain")]


@pytest.fixture(scope="module")
def recording():
    noise = np.random.default_rng(3)
    elements = [
        element(NAMES[0], list(noise.random((3, TICKS))), suffixes=("_x", "_y", "_z"), kind="array"),
        element(NAMES[1], [noise.integers(0, 9, TICKS, dtype="i1")]),
        element(NAMES[2], [np.array([b"stand", b"walk", b""] * (TICKS // 3), "S5")]),
        element(NAMES[3], [noise.random(TICKS // 10)], divider=10),
        element(NAMES[4], [noise.random(TICKS)]),
        element(NAMES[5], [noise.random(TICKS)]),
    ]
    return Recording("bag", np.arange(TICKS) * 10**6 + 10**18, TICKS, elements)


@pytest.fixture
def path(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("silo.files.bags.writer.CHUNK_BYTES", 20_000)  # many chunks
    write_bag(recording, tmp_path / "x.mcap")
    return tmp_path / "x.mcap"


@pytest.fixture
def read(monkeypatch):
    """Which elements were read together, in turn."""
    passes = []
    real = BagElements._read

    def noted(self, places):
        passes.append(places)
        return real(self, places)

    monkeypatch.setattr(BagElements, "_read", noted)
    return passes


def values(elements):
    return [[entry.values.tolist() for entry in one.entries] for one in elements]


def test_each_element_alone_is_what_the_whole_bag_gives(path, recording):
    wanted = read_bag(path).elements
    for place in range(len(wanted)):
        found = open_bag(path).elements[place]
        assert values([found]) == values([wanted[place]])
        assert [entry.values.dtype for entry in found.entries] == [
            entry.values.dtype for entry in wanted[place].entries
        ]
    assert values(open_bag(path).elements) == values(recording.elements)


def test_opening_reads_no_chunk(path, monkeypatch):
    def unpack(body):
        raise AssertionError("a chunk was unpacked")

    monkeypatch.setattr(bag_index, "unpack_chunk", unpack)
    log = silo.open_log(path)
    assert list(log) == NAMES
    assert log.duration_s == pytest.approx((TICKS - 1) * 1e-3)


def test_a_signal_reads_its_own_messages_alone(path, read):
    log = silo.open_log(path)
    assert log["force"].values.shape == (TICKS,)
    assert log["force"].values.shape == (TICKS,)
    assert read == [[4]]


def test_a_scalar_of_an_element_reads_its_own_messages_alone(path, read, recording):
    log = silo.open_log(path)
    assert "position_y" in log
    assert log["position_y"].values.tolist() == recording.elements[0].entries[1].values.tolist()
    assert read == [[0]]


def test_many_signals_take_one_pass_more(path, read):
    elements = read_recording(path).elements
    for place in range(len(elements)):
        _ = elements[place].entries[0].values
    assert read == [*[[place] for place in range(ALONE)], list(range(ALONE, len(elements)))]


def test_all_elements_take_one_pass(path, read):
    read_whole(read_recording(path))
    assert read == [list(range(len(NAMES)))]


def test_signals_that_are_asked_for_together_take_one_pass_and_nothing_else_is_read(path, read):
    log = silo.open_log(path)
    log.eval("force > 1 and position_x > 0")
    assert read == [[0, 4]]


def test_a_chunk_that_an_element_is_not_in_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("silo.files.bags.writer.CHUNK_BYTES", 20_000)
    noise = np.random.default_rng(4).random(TICKS)
    early = element("/log/early", [noise[:10]])
    write_bag(
        Recording("bag", np.arange(TICKS) + 10**18, TICKS, [early, element("/log/all", [noise])]), tmp_path / "x.mcap"
    )
    unpacked = []
    real = bag_index.unpack_chunk
    monkeypatch.setattr(bag_index, "unpack_chunk", lambda body: unpacked.append(1) or real(body))
    elements = open_bag(tmp_path / "x.mcap").elements
    assert [one.count for one in elements] == [10, TICKS]
    assert unpacked == []
    assert len(elements[0].entries[0].values) == 10
    assert len(unpacked) == 1
    assert len(elements[1].entries[0].values) == TICKS
    assert len(unpacked) > 3


def damaged(path, where):
    data = bytearray(path.read_bytes())
    data[where] ^= 0xFF
    path.write_bytes(data)


def test_a_damaged_chunk_is_told_of_when_it_is_read(path):
    chunk = read_index(memoryview(path.read_bytes())).chunks[1]
    damaged(path, chunk[0] + chunk[1] // 2)
    log = silo.open_log(path)
    assert list(log) == NAMES
    assert not log.warnings
    with pytest.warns(silo.LogWarning, match=r"x\.mcap: what was logged in the chunk at byte .* can't be read"):
        log["force"]
    assert len(log.warnings) == len(read_bag(path).warnings) == 1


def test_a_damaged_chunk_costs_what_is_in_it(path, recording):
    chunk = read_index(memoryview(path.read_bytes())).chunks[1]
    damaged(path, chunk[0] + chunk[1] // 2)
    with pytest.warns(silo.LogWarning):
        read_whole(bag := open_bag(path))
    lazily = bag.elements
    for found in (lazily, read_bag(path).elements):
        gone = set()
        for one, whole in zip(found, recording.elements, strict=True):
            assert one.count == whole.count
            assert 0 < one.failures.count < one.count
            (span,) = one.failures.spans
            gone.add(span)
            missing = np.zeros(one.count, bool)
            missing[span[0] // one.divider : span[1] // one.divider + 1] = True
            assert missing.sum() == one.failures.count
            for entry, before in zip(one.entries, whole.entries, strict=True):
                assert entry.values[~missing].tolist() == before.values[~missing].tolist()
                if entry.values.dtype.kind == "f":
                    assert np.isnan(entry.values[missing]).all()
                elif entry.values.dtype.kind == "S":
                    assert set(entry.values[missing].tolist()) == {b""}
                else:
                    assert np.ma.getmaskarray(entry.values)[missing].all()
        first, last = min(low for low, _ in gone), max(high for _, high in gone)
        assert all(low - first < 10 and last - high < 10 for low, high in gone)


def test_an_index_that_points_elsewhere_gives_no_other_value(path, recording):
    data = bytearray(path.read_bytes())
    index = read_index(memoryview(bytes(data))).chunks[1]
    places = index[2]["offset"].tolist()
    for place, other in zip(places, [*places[1:], places[0]], strict=True):
        data[place + 9 + 6 + 8 : place + 9 + 6 + 16] = data[other + 9 + 6 + 8 : other + 9 + 6 + 16]
    path.write_bytes(data)
    assert values(open_bag(path).elements) == values(recording.elements)
    assert values(read_bag(path).elements) == values(recording.elements)


@pytest.mark.parametrize("name", ["silo/recording.json.zst", "silo/time_ns.zst"])
def test_without_what_silo_wrote_beside_the_messages_they_are_read_as_those_of_others(path, recording, name):
    place, length = read_index(memoryview(path.read_bytes())).attachments[name]
    damaged(path, place + length - 30)
    with pytest.warns(silo.LogWarning, match="beside the messages can't be read .*wrong checksum.*as a bag of others"):
        log = silo.open_log(path)
    assert log["/log/force/value"].values.tolist() == recording.elements[4].entries[0].values.tolist()
    assert log["/log/force/value"].time_ns.tolist() == recording.time_ns.tolist()


def test_a_damaged_summary_is_not_believed_and_what_stands_where_is_found_by_the_records(path, recording, read):
    data = path.read_bytes()
    start = int.from_bytes(data[-28:-20], "little")
    damaged(path, start + 40)
    found = open_bag(path)
    assert read == []
    assert values(found.elements[4:5]) == values(recording.elements[4:5])
    assert read == [[4]]
    assert values(found.elements) == values(recording.elements)


@pytest.mark.parametrize("place", [0, 9, 11])  # opcode, channel, bytes of the entries
def test_behind_an_index_that_is_damaged_no_value_stands_at_another_time(path, recording, place):
    chunk = read_index(memoryview(path.read_bytes())).chunks[1]
    for at in chunk.offsets["offset"].tolist():
        damaged(path, at + place)
    assert values(open_bag(path).elements) == values(recording.elements)


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.999])
def test_what_is_cut_off_gives_what_is_whole_as_before(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.warns(silo.LogWarning, match="cut off"):
        log = silo.open_log(path)
    assert 0 < len(log["force"]) <= TICKS
    assert tuple(log.recording.warnings) == read_bag(path).warnings


def test_an_index_that_points_elsewhere_is_told_of(path):
    data = memoryview(path.read_bytes())
    with pytest.raises(ValueError, match="something else"):
        record_at(data, 8, Opcode.CHUNK)
    with pytest.raises(ValueError, match="out of the file"):
        record_at(data, len(data), Opcode.CHUNK)


@pytest.mark.slow
def test_a_changed_byte_of_the_summary_or_between_is_never_a_crash(path, recording):
    data = path.read_bytes()
    summary = int.from_bytes(data[-28:-20], "little")
    wanted = [(one.name, one.count) for one in recording.elements]
    for at in [*range(0, len(data), 997), *range(summary, len(data), 61), *range(len(data) - 40, len(data))]:
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        try:
            assert [(one.name, one.count) for one in open_bag(path).elements] == wanted
        except FileFormatError as error:
            assert "x.mcap" in str(error)


def test_the_heads_of_all_messages_of_a_chunk_are_looked_at_at_once(path, monkeypatch):
    looks = []

    def counted(chunk, wanted):
        looks.append(len(wanted))
        return right(chunk, wanted)

    right = channels.are_right
    monkeypatch.setattr(bag_index, "are_right", counted)
    monkeypatch.setattr(channels, "are_right", counted)
    read_whole(open_bag(path))
    assert len(looks) == len(read_index(memoryview(path.read_bytes())).chunks)
