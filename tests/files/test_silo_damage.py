"""Damaged and truncated `.silo` files: never a crash, always a message, and all that is whole."""

import time

import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.core.recording import Recording
from silo.errors import FileFormatError, LogNotFoundError
from silo.files.silo import format as form
from silo.files.silo.reader import damage_of, read_silo
from silo.files.silo.writer import write_silo


@pytest.fixture
def small(plan, recorded, tmp_path):
    """The bytes of a small file, with a vector, strings and a divided element."""
    plans = [
        plan("/log/a", unit="rad", description="angle of the arm"),
        plan("/log/with space", "<i2", divider=2, buffer_type=BufferType.FIXED),
        plan("/log/v", "<f4", "vector", labels=None),
        plan("/log/s", "|S4"),
        plan("/log/b", "|b1", lost=2),
    ]
    write_silo(recorded(plans, 5, warnings=()), tmp_path / "small.silo")
    return (tmp_path / "small.silo").read_bytes()


def opened(data, tmp_path):
    """The recording with all its values touched, or the error."""
    path = tmp_path / "damaged.silo"
    path.unlink(missing_ok=True)  # to write over a file waits for the disk: 3 ms of 4.5
    path.write_bytes(data)
    try:
        recording = read_silo(path)
    except FileFormatError as error:
        return error
    for element in recording.elements:
        assert element.stamp_indices.max(initial=-1) < len(recording.time_ns)
        assert element.stamp_indices.min(initial=0) >= 0
        for entry in element.entries:
            assert len(entry.values) == element.count
    return recording


def checked(data):
    """The file with a checksum that matches its header: what somebody else's program writes wrong."""
    head, rest = data.split(form.CHECK)
    return head + form.CHECK + form.checksum(head + form.DATA_LINE) + rest[8:]


def told_of(data, tmp_path):
    """What is told of a file whose values are held against their checksums, and by the rest of the damage in it."""
    path = tmp_path / "damaged.silo"
    path.unlink(missing_ok=True)
    path.write_bytes(data)
    assert read_silo(path, check=True).warnings == damage_of(path)
    return damage_of(path)


def values_at(data):
    return data.index(form.DATA_LINE) + len(form.DATA_LINE)


def has_message(result):
    return bool(str(result) if isinstance(result, FileFormatError) else result.warnings)


CHANGES = {
    "lowest bit": lambda byte: byte ^ 1,
    "case": lambda byte: byte ^ 0x20,
    "highest bit": lambda byte: byte ^ 0x80,
    "newline": lambda byte: 0x0A,
    "comment": lambda byte: 0x23,
    "space": lambda byte: 0x20,
    "digit": lambda byte: 0x39,
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_every_damaged_byte_of_the_header_is_told(small, change, tmp_path):
    end = small.index(b"# Binary Data\n") + len(b"# Binary Data\n")
    silent = []
    for index in range(end):
        damaged = bytearray(small)
        damaged[index] = CHANGES[change](damaged[index])
        if damaged != small and not has_message(opened(bytes(damaged), tmp_path)):
            silent.append((index, small[max(0, index - 20) : index + 20]))
    assert silent == []


def test_every_damaged_byte_of_the_values_is_told_with_the_name_of_its_signal(small, tmp_path):
    assert told_of(small, tmp_path) == ()
    table = [line.rsplit(b" ", 5) for line in small[: small.index(b"\n# silo ")].splitlines()[9:]]
    names = [row[0].decode() for row in table for _ in range(int(row[1]) * int(row[2]))]
    begin = values_at(small)
    assert len(names) == len(small) - begin
    for place, name in enumerate(names):
        damaged = bytearray(small)
        damaged[begin + place] ^= 0x10
        (told,) = told_of(bytes(damaged), tmp_path)
        assert told.startswith(f"values of '{name}' are damaged: ")


def test_what_is_overwritten_in_several_signals_names_each(small, tmp_path):
    begin = values_at(small)
    (told,) = told_of(small[:begin] + bytes(100) + small[begin + 100 :], tmp_path)
    assert told.startswith("values of '/log/time_s', '/log/time_ns', '/log/a' are damaged: ")
    assert "'/log/b'" not in told


def test_a_file_without_checksums_is_read_as_before(small, tmp_path):
    begin = small.index(form.SUMS)
    end = small.index(b"\n", begin) + 1
    before = checked(small[:begin] + small[end:])
    assert told_of(before, tmp_path) == ()
    damaged = before[:-1] + bytes([before[-1] ^ 1])
    assert told_of(damaged, tmp_path) == ()
    assert opened(damaged, tmp_path).warnings == ()


def test_of_a_file_that_is_cut_the_values_that_are_there_are_held_against_their_checksums(small, tmp_path):
    begin = values_at(small)
    damaged = bytearray(small[:-3])
    damaged[begin] ^= 1
    cut, wrong = told_of(bytes(damaged), tmp_path)
    assert "3 bytes are missing" in cut
    assert wrong.startswith("values of '/log/time_s' are damaged")


def test_where_the_table_is_damaged_no_checksum_is_held_against_other_values(small, tmp_path):
    damaged = small.replace(b"/log/v_y 4", b"/log/v_y x", 1)
    assert not [text for text in told_of(damaged, tmp_path) if text.startswith("values of")]


def test_values_that_are_written_in_many_tiles_have_one_checksum(plan, recorded, tmp_path, monkeypatch):
    monkeypatch.setattr("silo.files.silo.writer.TILE_ROWS", 7)
    monkeypatch.setattr("silo.files.silo.writer.BLOCK_ROWS", 3)
    plans = [plan(f"/log/x{k}", dtype, divider=1 + k % 3) for k, dtype in enumerate(["<f8", "|S5", "<i2", ">f4"] * 6)]
    recording = recorded([*plans, plan("/log/empty", "|S1")], 50)
    recording.elements[-1].entries[0].values[:] = b""
    write_silo(recording, tmp_path / "x.silo")
    assert damage_of(tmp_path / "x.silo") == ()


@pytest.mark.slow
def test_a_file_cut_at_any_length_is_told_and_in_its_header_has_no_values(small, tmp_path):
    found = [opened(small[:length], tmp_path) for length in range(len(small))]
    assert [length for length, one in enumerate(found) if not has_message(one)] == []
    headers = found[: values_at(small)]
    assert not any(entry.count for one in headers if isinstance(one, Recording) for entry in one.elements)


def test_a_cut_file_gives_every_whole_value(small, tmp_path):
    whole = {
        entry.name: entry.values.tolist() for element in opened(small, tmp_path).elements for entry in element.entries
    }
    start = small.index(b"# Binary Data\n") + len(b"# Binary Data\n")
    for length in range(start, len(small)):
        position = start + 2 * 5 * 8
        found = {
            entry.name: entry.values.tolist()
            for element in opened(small[:length], tmp_path).elements
            for entry in element.entries
        }
        for name, values in whole.items():
            size = {"/log/a": 8, "/log/with space": 2, "/log/s": 0, "/log/b": 1}.get(name, 4)
            if name == "/log/s":
                size = max(len(text) for text in values)
            there = min(len(values), max(0, length - position) // size)
            assert repr(found.get(name, [])) == repr(values[:there])
            position += size * len(values)
        assert position == len(small)


def test_the_warning_of_a_cut_file_names_what_is_missing(small, tmp_path):
    recording = opened(small[:-9], tmp_path)
    assert "9 bytes are missing" in recording.warnings[-1]
    assert "lost: /log/b" in recording.warnings[-1]
    assert "'/log/s' has" in recording.warnings[-1]


def test_times_of_a_cut_looping_element_stay_right(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", divider=3, size=4)], 20)
    write_silo(recording, tmp_path / "x.silo")
    cut = opened((tmp_path / "x.silo").read_bytes()[:-16], tmp_path)
    assert cut.elements[0].stamp_indices.tolist() == recording.elements[0].stamp_indices.tolist()[:2]


def test_a_vector_that_is_cut_off_gives_its_whole_components(plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/v", kind="vector")], 5), tmp_path / "x.silo")
    cut = opened((tmp_path / "x.silo").read_bytes()[: -5 * 8 - 1], tmp_path)
    assert [(element.name, element.count) for element in cut.elements] == [("/log/v_x", 5), ("/log/v_y", 4)]


def test_bytes_after_the_end_are_told(small, tmp_path):
    assert "3 bytes after the last value are ignored" in opened(small + b"abc", tmp_path).warnings[0]


def test_with_a_damaged_line_of_the_table_all_other_elements_are_read(small, tmp_path):
    whole, damaged = opened(small, tmp_path), opened(small.replace(b"/log/v_y 4", b"/log/v_y x", 1), tmp_path)
    expected = {entry.name: entry.values.tolist() for e in whole.elements for entry in e.entries}
    found = {entry.name: entry.values.tolist() for e in damaged.elements for entry in e.entries}
    assert set(expected) - set(found) == {"/log/v_y"}
    assert all(repr(found[name]) == repr(expected[name]) for name in found)
    number = small[: small.index(b"/log/v_y 4")].count(b"\n") + 1
    assert any(text.startswith(f"line {number}, of the table, can't be read") for text in damaged.warnings)


@pytest.mark.parametrize(("looping", "kept"), [(0, slice(0, 5)), (1, slice(1, 6))])
def test_one_sample_more_than_time_stamps_is_left_out_though_the_checksum_matches(small, tmp_path, looping, kept):
    forged = checked(small.replace(b"/log/b 1 5 1 1", b"/log/b 1 6 1 %d" % looping)) + b"\1"
    recording = opened(forged, tmp_path)
    (warning,) = recording.warnings
    assert warning == "'/log/b' has samples without a time stamp; they are left out"
    last = recording.elements[-1]
    assert last.stamp_indices.tolist() == [0, 1, 2, 3, 4]
    assert last.entries[0].values.tobytes() == forged[-6:][kept]


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "other.silo.* is empty"), *((one, r"other\.silo") for one in (
        b"\0", b"\n", b"hello\nworld\n", bytes(range(256)) * 40, b"#\n" * 1000))],
)  # fmt: skip
def test_any_other_file_is_an_error_that_names_it(content, words, tmp_path):
    path = tmp_path / "other.silo"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=words):
        read_silo(path)


def test_a_missing_file_and_a_folder_are_errors(tmp_path):
    with pytest.raises(LogNotFoundError, match="no file"):
        read_silo(tmp_path / "none.silo")
    with pytest.raises(LogNotFoundError, match="directory"):
        read_silo(tmp_path)


def test_values_are_read_only_views_of_the_file(small, tmp_path):
    values = opened(small, tmp_path).elements[0].entries[0].values
    assert not values.flags.writeable
    assert not values.flags.owndata
    assert isinstance(values, np.ndarray)


def test_a_header_that_ends_otherwise_is_told(small, tmp_path):
    recording = opened(small.replace(form.DATA_LINE, b"# Binary Date\n", 1), tmp_path)
    assert recording.warnings == ("the header is damaged: its last line is not '# Binary Data'",)


def test_a_header_whose_checksum_is_gone_is_told_where_it_has_facts_of_silo(small, tmp_path):
    begin = small.index(form.CHECK)
    recording = opened(small[:begin] + small[small.index(b"\n", begin) + 1 :], tmp_path)
    assert "the header is damaged: its checksum is missing" in recording.warnings


def test_a_large_table_with_a_damaged_line_is_read_as_fast_as_a_whole_one(plan, recorded, tmp_path):
    write_silo(recorded([plan(f"/log/x{number}") for number in range(25_000)], 1), tmp_path / "large.silo")
    data = (tmp_path / "large.silo").read_bytes().replace(b"/log/x9 8 ", b"/log/x9 ? ", 1)
    (tmp_path / "large.silo").write_bytes(data)
    begun_s = time.process_time()
    assert len(read_silo(tmp_path / "large.silo").elements) == 24_999
    assert time.process_time() - begun_s < 3.0  # 0.5 s; 5 to 12 s where each is looked for among all others
