"""What is written to `.silo` comes back, and the readers of the original find what they expect."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.analysis.opening import open_log
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import SaveError
from silo.files.silo import reader
from silo.files.silo.reader import read_silo
from silo.files.silo.writer import write_silo
from tests.examples import examples

QUICK = settings(max_examples=examples(120))


def mini_reader(path):
    """A reader after the description of the original's two: MATLAB for the header, exact data start, no facts."""
    with path.open("rb") as file:

        def value_line():
            while (line := file.readline()).startswith(b"#") or not line.strip():
                assert b"Binary Data" not in line
                assert line
            return line.rstrip(b"\n")

        offset, count = int(value_line()), int(value_line())
        table = [value_line()] + [file.readline().rstrip(b"\n") for _ in range(count - 1)]
        # the Python reader: every line with '#' is skipped until one contains 'Binary Data'
        while b"Binary Data" not in (line := file.readline()):
            assert line.startswith(b"#")
        assert line == b"# Binary Data\n"
        entries = []
        for row in table:
            match = re.fullmatch(rb"(.*) (\d+) (\d+) (\d+) ([01]) (\w+)", row, re.DOTALL)
            name, size, samples, divider, looping, kind = match.groups()
            data = file.read(int(size) * int(samples))
            assert len(data) == int(size) * int(samples)
            entries.append((name.decode(), int(size), int(samples), int(divider), int(looping), kind.decode(), data))
        assert file.read() == b""
    return offset, entries


def original_stamps(looping, n, m, divider, offset):
    if looping:
        return [n - 1 - (offset - 1) % divider - (m - 1 - i) * divider for i in range(m)]
    return [i * divider for i in range(m)]


@pytest.mark.slow
@QUICK
@given(data=st.data())
def test_everything_survives_a_round_trip(data, any_recording, bits_of, tmp_path_factory):
    recording = data.draw(any_recording())
    path = tmp_path_factory.mktemp("silo") / "x.silo"
    write_silo(recording, path)
    again = read_silo(path)
    written = [element for element in recording.elements if element.count]
    assert [element.name for element in again.elements] == [element.name for element in written]
    np.testing.assert_array_equal(again.time_ns, recording.time_ns)
    for name in ("logger", "offset", "prefix", "frequency_hz", "started_ns", "time_looping", "warnings"):
        assert getattr(again, name) == getattr(recording, name)
    for before, after in zip(written, again.elements, strict=True):
        for name in ("unit", "kind", "shape", "divider", "buffer_type", "first", "description", "lost", "count"):
            assert getattr(after, name) == getattr(before, name)
        for one, other in zip(before.entries, after.entries, strict=True):
            assert (other.name, other.entry) == (one.name, one.entry)
            assert bits_of(other.values) == bits_of(one.values)


@pytest.mark.slow
@QUICK
@given(data=st.data())
def test_the_readers_of_the_original_get_values_and_time_stamps(data, any_recording, bits_of, tmp_path_factory):
    recording = data.draw(any_recording())
    path = tmp_path_factory.mktemp("silo") / "x.silo"
    write_silo(recording, path)
    offset, entries = mini_reader(path)
    assert offset == recording.offset
    (seconds, nanoseconds), rest = entries[:2], entries[2:]
    assert (seconds[0], nanoseconds[0]) == ("/log/time_s", "/log/time_ns")
    assert seconds[3:6] == nanoseconds[3:6] == (1, int(recording.time_looping), "int64")
    time_ns = np.frombuffer(seconds[6], "<i8") * 10**9 + np.frombuffer(nanoseconds[6], "<i8")
    np.testing.assert_array_equal(time_ns, recording.time_ns)
    written = [(element, entry) for element in recording.elements if element.count for entry in element.entries]
    for (element, entry), (_, size, samples, divider, looping, kind, raw) in zip(written, rest, strict=True):
        stamps = original_stamps(looping, len(time_ns), samples, divider, offset)
        assert stamps == element.stamp_indices.tolist()
        values = entry.values
        if kind == "string":
            texts = [raw[i * size : (i + 1) * size].rstrip(b"-") for i in range(samples)]
            assert texts == bits_of(values)
        elif values.dtype.str == "<f2":
            assert kind == "single"
            np.testing.assert_array_equal(np.frombuffer(raw, "<f4"), values.astype("<f4"))
        else:
            assert raw == np.ascontiguousarray(values).tobytes()


TYPE_RULES = {
    "<f8": ("double", 8),
    "<f4": ("single", 4),
    "<f2": ("single", 4),
    "<f16": ("unknown", 16),
    "|i1": ("int8", 1),
    "<i2": ("int16", 2),
    "<i4": ("int32", 4),
    "<i8": ("int64", 8),
    "|u1": ("uint8", 1),
    "<u2": ("uint16", 2),
    "<u4": ("uint32", 4),
    "<u8": ("uint64", 8),
    "|b1": ("uint8", 1),
    "<M8[ns]": ("int64", 8),
    "<m8[s]": ("int64", 8),
    ">f8": ("double", 8),
    ">i2": ("int16", 2),
}


@pytest.mark.parametrize("dtype", TYPE_RULES)
def test_each_type_has_the_name_and_size_of_the_format(dtype, plan, recorded, tmp_path, monkeypatch):
    write_silo(recorded([plan("/log/a", dtype)], 4), tmp_path / "x.silo")
    assert mini_reader(tmp_path / "x.silo")[1][2][5::-4] == (TYPE_RULES[dtype][0], TYPE_RULES[dtype][1])
    monkeypatch.setattr(reader, "_repaired", None)  # a file that is whole needs no repair, which takes longer
    assert read_silo(tmp_path / "x.silo").elements[0].entries[0].dtype == np.dtype(dtype).newbyteorder("<")


def test_strings_are_padded_with_dashes_to_the_longest(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", "|S8")], 3)
    recording.elements[0].entries[0].values[:] = [b"ab", b"", b"abcd"]
    write_silo(recording, tmp_path / "x.silo")
    assert mini_reader(tmp_path / "x.silo")[1][2][1:] == (4, 3, 1, 1, "string", b"ab------abcd")


def test_strings_that_are_all_empty_have_no_bytes(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", "|S8")], 3)
    recording.elements[0].entries[0].values[:] = b""
    write_silo(recording, tmp_path / "x.silo")
    assert mini_reader(tmp_path / "x.silo")[1][2][1:] == (0, 3, 1, 1, "string", b"")
    assert read_silo(tmp_path / "x.silo").elements[0].entries[0].values.tolist() == [b"", b"", b""]


def test_the_header_is_that_of_the_original_up_to_the_table(plan, recorded, fixtures_folder, tmp_path):
    write_silo(recorded([plan("/log/a")], 3), tmp_path / "x.silo")
    ours = (tmp_path / "x.silo").read_bytes().split(b"\n")[:10]
    theirs = (fixtures_folder / "looping_wrapped.silo").read_bytes().split(b"\n")[:10]
    ours[3] = theirs[3]
    ours[5], ours[7] = theirs[5], theirs[7]
    ours[9] = theirs[9] = b""
    assert ours == theirs


def test_elements_without_a_sample_are_left_out(plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/a"), plan("/log/b")], 0), tmp_path / "x.silo")
    assert [entry[0] for entry in mini_reader(tmp_path / "x.silo")[1]] == ["/log/time_s", "/log/time_ns"]
    assert read_silo(tmp_path / "x.silo").elements == ()


def test_data_starts_aligned(plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/a")], 3), tmp_path / "x.silo")
    assert read_silo(tmp_path / "x.silo").elements[0].entries[0].values.flags.aligned


def test_a_fixed_buffer_that_lost_its_first_stamps_keeps_its_times(plan, recorded, tmp_path):
    from dataclasses import replace

    recording = recorded([plan("/log/a", buffer_type=BufferType.FIXED, divider=3)], 20)
    recording = replace(recording, elements=[replace(recording.elements[0], first=5, lost=2)])
    write_silo(recording, tmp_path / "x.silo")
    assert read_silo(tmp_path / "x.silo").elements[0].first == 5


def test_a_log_larger_than_a_tile_is_transposed_right(tmp_path):
    from silo.core.elements import Entry
    from silo.core.recording import RecordedElement, RecordedEntry, Recording

    rows = np.arange(40_000 * 20, dtype=np.float64).reshape(40_000, 20)
    names = [f"/log/e{i}" for i in range(20)]
    elements = [
        RecordedElement(
            name,
            "-",
            "scalar",
            (),
            1 + (i > 10),
            BufferType.GROWING,
            0,
            (RecordedEntry(name, Entry("", "<f8"), rows[: 40_000 // (1 + (i > 10)), i]),),
        )
        for i, name in enumerate(names)
    ]
    recording = Recording("robot", np.arange(40_000, dtype=np.int64), 40_000, elements)
    fractions = []
    write_silo(recording, tmp_path / "x.silo", fractions.append)
    for element, again in zip(elements, read_silo(tmp_path / "x.silo").elements, strict=True):
        np.testing.assert_array_equal(again.entries[0].values, element.entries[0].values)
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_a_path_with_the_word_binary_data_does_not_confuse_the_old_readers(plan, recorded, tmp_path):
    folder = tmp_path / "Binary Data"
    folder.mkdir()
    write_silo(recorded([plan("/log/a")], 3), folder / "x.silo")
    assert len(mini_reader(folder / "x.silo")[1]) == 3


def test_objects_can_not_be_saved_and_nothing_is_left(plan, recorded, tmp_path):
    from dataclasses import replace

    recording = recorded([plan("/log/a")], 3)
    element = recording.elements[0]
    entry = replace(element.entries[0], values=np.array([1, "a", None], object))
    recording = replace(recording, elements=[replace(element, entries=(entry,))])
    with pytest.raises(SaveError, match="'/log/a' holds Python objects"):
        write_silo(recording, tmp_path / "x.silo")
    assert list(tmp_path.iterdir()) == []


ORDERS = {
    "as they lie": list(range(40)),
    "backwards": list(range(40))[::-1],
    "every second": list(range(0, 40, 2)),
    "one of them often": [3] * 5 + [7, 3, 7, 3],
    "mixed": [5, 6, 7, 1, 3, 5, 7, 39, 0, 1, 2, 30, 20, 10],
}


@pytest.mark.parametrize("columns", ORDERS.values(), ids=list(ORDERS))
@pytest.mark.parametrize("dtype", ["<f8", "<f4", ">f8", "?", "<M8[ns]"])
def test_columns_of_a_matrix_are_written_as_they_are_in_any_order(tmp_path, columns, dtype):
    count = 2500  # more than two blocks
    rows = np.arange(40 * count, dtype=np.int64).reshape(count, 40)
    fields = [rows[:, place].astype(dtype) for place in range(40)]
    matrix = np.empty((count, 41), dtype)
    matrix[:, :40] = np.stack(fields, axis=1)
    elements = []
    for number, place in enumerate(columns):
        # neighbours of another length or type in between
        values = matrix[: 100 if number % 11 == 9 else count, place]
        values = rows[:, place] if number % 7 == 6 else values
        entry = RecordedEntry(f"/x{number}", Entry("", values.dtype.newbyteorder("<").str), values)
        elements.append(RecordedElement(f"/x{number}", "-", "scalar", (), 1, BufferType.FIXED, 0, (entry,)))
    time_ns = np.arange(count, dtype=np.int64) * 1_000_000
    write_silo(Recording("bench", time_ns, count, elements, frequency_hz=1000.0), tmp_path / "x.silo")
    again = {one.name: one.entries[0].values for one in read_silo(tmp_path / "x.silo").elements}
    for element in elements:
        expected = element.entries[0].values
        assert again[element.name].tolist() == expected.tolist(), element.name


@pytest.mark.parametrize("dtype", ["S12", "U12"])
def test_texts_keep_the_dashes_at_their_ends(dtype, tmp_path):
    texts = ["phase-", "", "-", "a--", "plain", "----", "a-b"]
    entry = RecordedEntry("/log/s", Entry("", np.dtype(dtype).str), np.array(texts, dtype))
    element = RecordedElement("/log/s", "-", "scalar", (), 1, BufferType.GROWING, 0, (entry,))
    path = tmp_path / "x.silo"
    write_silo(Recording("r", 10**18 + np.arange(len(texts)), len(texts), (element,)), path)
    assert open_log(path)["s"].values.tolist() == texts
    (again,) = read_silo(path).elements
    assert [value.decode() for value in again.entries[0].values.tolist()] == texts
    path.write_bytes(path.read_bytes()[:-1])  # the tolerant reader
    assert open_log(path)["s"].values.tolist()[:6] == texts[:6]
