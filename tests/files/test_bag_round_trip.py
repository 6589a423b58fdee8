"""Bags that silo wrote come back with every value bit for bit, and nothing half-written is ever left."""

import errno
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from silo.core.recording import Recording
from silo.errors import FileFormatError, LogNotFoundError, SaveError
from silo.files.bags import writer as bag
from silo.files.bags.ros_types import channels_of
from silo.files.bags.writer import write_bag
from silo.files.mcap import writer as mcap_write
from tests.examples import examples
from tests.stand_ins.saved import element
from tests.whole_bags import read_bag

ALL_TYPES = ("<f8", ">f8", "<f4", "<f2", "<c8", "<c16", "|i1", "<i2", ">i4", "<i8", "|u1", "<u8", "|V5", "<f16", "|S3")


def recording(*elements, ticks=50, time_ns=None):
    if time_ns is None:
        time_ns = 1_700_000_000_000_000_001 + np.arange(ticks, dtype=np.int64) * 2_500_001
    return Recording("robot", time_ns, ticks, elements)


def random_bits(dtype, count, seed=0):
    dtype = np.dtype(dtype)
    return np.random.default_rng(seed).integers(0, 256, count * dtype.itemsize, dtype=np.uint8).view(dtype)


def assert_same(read, written):
    assert read.time_ns.tolist() == written.time_ns.tolist()
    assert replace(read, time_ns=0, elements=()) == replace(written, time_ns=0, elements=())
    assert len(read.elements) == len(written.elements)
    for ours, theirs in zip(read.elements, written.elements, strict=True):
        assert replace(ours, entries=()) == replace(theirs, entries=())
        for a, b in zip(ours.entries, theirs.entries, strict=True):
            assert (a.name, a.entry, a.values.dtype) == (b.name, b.entry, b.values.dtype)
            assert a.values.tobytes() == b.values.tobytes(), a.name


@given(data=st.data())
@settings(max_examples=examples(80))
def test_any_recording_survives_a_bag_bit_for_bit(data, any_recording, tmp_path_factory):
    written = data.draw(any_recording())
    if len(written.time_ns) and written.time_ns.min() < 0:
        written = replace(written, time_ns=written.time_ns - written.time_ns.min())
    path = tmp_path_factory.mktemp("bag") / "any.mcap"
    write_bag(written, path)
    assert_same(read_bag(path), written)


@pytest.mark.parametrize("dtype", ALL_TYPES)
def test_every_bit_pattern_of_a_type_survives(dtype, tmp_path):
    written = recording(element("/log/x", random_bits(dtype, 50)))
    write_bag(written, tmp_path / "x.mcap")
    assert_same(read_bag(tmp_path / "x.mcap"), written)


def test_signalling_nans_of_a_float32_pose_stay_signalling(tmp_path):
    bits = np.array([0x7FA00001, 0xFF800001, 0x7FC00000, 0x80000000, 0x7F800000], dtype="<u4")
    suffixes = [f"_position_{a}" for a in "xyz"] + [f"_orientation_{a}" for a in "xyzw"]
    pose = element("/log/pose", [bits.view("<f4")] * 7, kind="pose", suffixes=suffixes, shape=(7,))
    write_bag(recording(pose, ticks=5), tmp_path / "x.mcap")
    read = read_bag(tmp_path / "x.mcap").elements[0].entries[3].values
    assert read.view("<u4").tolist() == bits.tolist()


def test_a_folder_comes_back_like_a_file(tmp_path):
    written = recording(element("/log/x", random_bits("<f8", 50)))
    write_bag(written, tmp_path / "run")
    assert_same(read_bag(tmp_path / "run"), written)


def test_windows_and_chunks_of_any_size_give_the_same_recording(tmp_path, monkeypatch):
    monkeypatch.setattr(bag, "WINDOW_BYTES", 4000)
    monkeypatch.setattr(bag, "CHUNK_BYTES", 700)
    texts = np.array([b"", b"a", b"longer"] * 100, dtype="S6")
    written = recording(
        element("/log/x", random_bits("<f8", 300)),
        element("/log/y", random_bits("<f8", 42), divider=7, first=3),
        element("/log/s", texts),
        element("/log/late", random_bits("<i2", 2), divider=50, first=249),
        ticks=300,
    )
    write_bag(written, tmp_path / "x.mcap")
    assert_same(read_bag(tmp_path / "x.mcap"), written)


def test_a_clock_that_jumps_back_keeps_the_order_of_samples(tmp_path):
    time_ns = np.array([5, 3, 3, 10**18, 0], dtype=np.int64)
    written = recording(element("/log/x", np.arange(5.0)), ticks=5, time_ns=time_ns)
    write_bag(written, tmp_path / "x.mcap")
    assert_same(read_bag(tmp_path / "x.mcap"), written)


def test_ticks_without_any_sample_keep_their_stamps(tmp_path):
    written = recording(element("/log/x", np.arange(5.0), divider=10))
    write_bag(written, tmp_path / "x.mcap")
    assert len(read_bag(tmp_path / "x.mcap").time_ns) == 50


@pytest.mark.parametrize("name", ["empty.mcap", "empty"])
def test_a_recording_without_samples_is_a_valid_bag(name, tmp_path):
    written = recording(element("/log/x", np.zeros(0)), ticks=0)
    write_bag(written, tmp_path / name)
    assert_same(read_bag(tmp_path / name), written)


def test_topics_with_names_that_ros_forbids_stay_apart():
    names = ["/log/a b", "/log/a_b", "/log/1st", "/log/ü", ""]
    topics = [c.topic for c in channels_of([element(name, np.zeros(1), prefix="") for name in names])]
    assert topics == ["/log/a_b", "/log/a_b_2", "/log/_1st", "/log/_", "/unnamed"]


@pytest.mark.parametrize("stamp", [-1, 2**31 * 10**9, 2**63 - 1])
def test_a_stamp_that_ros_cannot_hold_is_refused_with_its_range(stamp, tmp_path):
    written = recording(element("/log/x", np.zeros(1)), ticks=1, time_ns=np.array([stamp]))
    with pytest.raises(SaveError, match=f"{stamp} ns.*0 to 2147483647999999999"):
        write_bag(written, tmp_path / "x.mcap")
    assert list(tmp_path.iterdir()) == []


def test_values_that_are_python_objects_are_refused_by_name(tmp_path):
    with pytest.raises(SaveError, match=r"/log/x.*object"):
        write_bag(recording(element("/log/x", np.array([None] * 50))), tmp_path / "x.mcap")


def test_samples_without_a_time_stamp_are_refused_by_name(tmp_path):
    with pytest.raises(SaveError, match=r"/log/x.*time stamps 1 to 50"):
        write_bag(recording(element("/log/x", np.zeros(50), first=1)), tmp_path / "x.mcap")


@pytest.mark.parametrize("name", ["full.mcap", "full"])
def test_a_full_disk_is_a_save_error_and_leaves_nothing(name, tmp_path, monkeypatch):
    written = recording(element("/log/x", np.zeros(50)))
    real = mcap_write.write_all

    def full(descriptor, buffers, offset):
        if offset > 500:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(descriptor, buffers, offset)

    monkeypatch.setattr(mcap_write, "write_all", full)
    with pytest.raises(SaveError, match="No space left"):
        write_bag(written, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["half.mcap", "half"])
def test_ctrl_c_leaves_nothing(name, tmp_path):
    def interrupt(_fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_bag(recording(element("/log/x", np.zeros(50))), tmp_path / name, interrupt)
    assert list(tmp_path.iterdir()) == []


def test_progress_ends_at_one(tmp_path, monkeypatch):
    monkeypatch.setattr(bag, "WINDOW_BYTES", 1000)
    seen = []
    write_bag(recording(element("/log/x", np.zeros(50))), tmp_path / "x.mcap", seen.append)
    assert seen == sorted(seen)
    assert len(seen) > 2
    assert seen[-1] == 1.0


def test_memory_stays_bounded_however_long_the_log(tmp_path, monkeypatch):
    monkeypatch.setattr(bag, "WINDOW_BYTES", 1 << 18)
    monkeypatch.setattr(bag, "CHUNK_BYTES", 1 << 16)
    values = np.zeros(100_000)
    written = recording(*(element(f"/log/x{i}", values) for i in range(5)), ticks=100_000)
    tracemalloc.start()
    write_bag(written, tmp_path / "x.mcap")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # the messages take 30 MB; a time stamp per tick is held
    assert peak < 6e6


class TestDamage:
    """A damaged file is a message, never a crash."""

    @pytest.fixture
    def small(self, tmp_path, monkeypatch):
        monkeypatch.setattr(bag, "CHUNK_BYTES", 700)
        written = recording(
            element("/log/x", np.arange(24.0)), element("/log/s", np.array([b"ab", b""] * 12)), ticks=24
        )
        path = tmp_path / "small.mcap"
        write_bag(written, path)
        return written, path

    @pytest.mark.slow
    @pytest.mark.sampled
    def test_a_file_cut_at_any_length_gives_what_is_whole(self, small, drawn):
        _, path = small
        data = path.read_bytes()
        whole = []
        for length in drawn(range(len(data)), 600):
            path.write_bytes(data[:length])
            try:
                read = read_bag(path)
            except FileFormatError as error:
                assert "small.mcap" in str(error)
                continue
            first = read.elements[0].entries[0].values
            assert first.tolist() == list(range(len(first)))
            assert read.warnings
            whole.append(len(first))
        assert whole == sorted(whole)
        assert len(set(whole)) > 3

    @pytest.mark.slow
    @pytest.mark.sampled
    def test_a_changed_byte_anywhere_is_never_a_crash(self, small, drawn):
        _, path = small
        data = path.read_bytes()
        for at in drawn(range(len(data)), 600):
            flip = 0xFF if at % 2 else 0x01
            path.write_bytes(data[:at] + bytes([data[at] ^ flip]) + data[at + 1 :])
            try:
                read_bag(path)
            except FileFormatError as error:
                assert "small.mcap" in str(error)

    @pytest.mark.slow
    @pytest.mark.sampled
    @pytest.mark.parametrize("width", [64, 1 << 20], ids=["within", "at the end"])
    def test_zeros_as_a_power_cut_leaves_them_are_no_values_and_move_none(self, small, drawn, width):
        written, path = small
        data = path.read_bytes()
        x, s = (one.entries[0].values.tolist() for one in written.elements)
        for at in drawn(range(len(data)), 200):
            path.write_bytes(data[:at] + bytes(len(data[at : at + width])) + data[at + width :])
            try:
                read = {one.name: one.entries[0].values.tolist() for one in read_bag(path).elements}
            except FileFormatError:
                continue
            assert all(value in (x[k], None) or value != value for k, value in enumerate(read.get("/log/x", [])))
            assert all(value in (s[k], b"") for k, value in enumerate(read.get("/log/s", [])))

    def test_a_changed_value_is_noticed_by_its_checksum(self, small):
        _, path = small
        data = path.read_bytes()
        at = data.index(b"zstd", data.index(b"silo/time_ns")) + 40
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        with pytest.raises(FileFormatError, match="damaged"):
            read_bag(path)


def test_the_bag_of_another_program_is_named_as_such(tmp_path):
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with pytest.raises(FileFormatError, match=r"other.mcap.*not written by silo"):
        read_bag(path)


@pytest.mark.parametrize(("content", "reason"), [(b"", "empty"), (b"PK\3\4" * 9, "not an MCAP file")])
def test_what_is_no_bag_says_so(content, reason, tmp_path):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=reason):
        read_bag(path)


def test_a_bag_that_is_missing_says_so(tmp_path):
    with pytest.raises(LogNotFoundError, match=r"x\.mcap"):
        read_bag(tmp_path / "x.mcap")
