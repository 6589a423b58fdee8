"""`<name>.csv.json`: what a CSV file can't say, taken only where it is of that very table."""

import json

import numpy as np
import pytest

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.convert import convert
from silo.files.csv.reader import read_csv
from silo.files.csv.writer import write_csv
from silo.files.silo.reader import read_silo
from tests.rows_csv import write_rows

UNKNOWN = "units, labels, types and buffers of the log are not known"


@pytest.fixture
def path(plan, recorded, tmp_path):
    plans = [
        plan("/log/q", "<f4", "quaternion", divider=2, size=3, unit="-", description="where to"),
        plan("/log/mode", "|i1", size=4, unit="x", labels={0: "STAND"}, lost=2),
        plan("/log/on", "|b1", buffer_type=BufferType.FIXED, size=5),
        plan("/log/when", "<M8[ms]"),
    ]
    write_csv(recorded(plans, 8, frequency_hz=500.0), tmp_path / "x.csv")
    return tmp_path / "x.csv"


def facts_of(recording):
    """All that a recording says of its elements, but for their values."""
    said = ("name", "unit", "kind", "shape", "divider", "buffer_type", "first", "lost", "description", "dtype")
    entries = [[entry.entry for entry in element.entries] for element in recording.elements]
    return [[getattr(element, name) for name in said] for element in recording.elements], entries


@pytest.mark.parametrize("write", [write_csv, write_rows])
def test_a_table_with_its_facts_is_the_log_that_was_saved(write, plan, recorded, tmp_path):
    before = recorded(
        [plan("/log/q", "<f4", "quaternion", divider=2, unit="rad", labels=None), plan("/log/t", "|S5")], 9
    )
    write(before, tmp_path / "x.csv")
    after = read_csv(tmp_path / "x.csv")
    assert facts_of(after) == facts_of(before)
    assert (after.logger, after.offset, after.warnings) == (before.logger, before.offset, ())
    assert after.elements[0].entries[0].values.dtype == np.float32


def test_a_value_that_was_edited_is_taken(path):
    lines = path.read_text().splitlines(keepends=True)
    cells = lines[-1].split(",")
    cells[5] = "1"
    path.write_text("".join([*lines[:-1], ",".join(cells)]))
    again = read_csv(path)
    assert again.warnings == ()
    assert again.elements[1].entries[0].values[-1] == 1


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda lines: lines[:-1], "its time stamps are others"),
        (lambda lines: [lines[0].replace("mode", "made"), *lines[1:]], "its columns are others"),
        (lambda lines: [*lines[:-1], lines[-1].replace("1700000000.1", "1800000000.1")], "its time stamps are others"),
        (
            lambda lines: [lines[0], lines[1].rsplit(",", 2)[0] + ",," + lines[1].rsplit(",", 1)[1], *lines[2:]],
            "has its samples at other ticks",
        ),
        (
            lambda lines: [lines[0], lines[1].rsplit(",", 2)[0] + ",x," + lines[1].rsplit(",", 1)[1], *lines[2:]],
            "are no <M8",
        ),
    ],
)
def test_facts_of_another_table_are_left_out_with_a_warning(change, why, path):
    path.write_text("".join(change(path.read_text().splitlines(keepends=True))))
    *others, warning = [one for one in read_csv(path).warnings if "is taken as texts: 1 of " not in one]
    assert others in ([], ["its last column, 'time_ns', is not 'time' in nanoseconds: it is left out"])
    assert "'x.csv.json' is not of this table" in warning
    assert why in warning
    assert UNKNOWN in warning


@pytest.mark.parametrize(
    "text", [b"", b"{", b"[]", b"\xff", b'{"version": 2}', b"[" * 100_000, b'{"version":1,"log":{"logger":"x"}}']
)
def test_facts_that_are_none_are_left_out_with_a_warning(text, path):
    (path.parent / "x.csv.json").write_bytes(text)
    assert "'x.csv.json' is not of this table" in read_csv(path).warnings[0]


@pytest.mark.parametrize("dtype", ["O", "<f8,<f8", "|V99999999999", "nonsense", "|S99999999999", "<c8", "f8,("])
def test_a_type_that_the_values_are_not_is_no_error(dtype, path):
    beside = path.parent / "x.csv.json"
    facts = json.loads(beside.read_bytes())
    facts["elements"][2]["entries"][0]["dtype"] = dtype
    beside.write_text(json.dumps(facts))
    assert len(read_csv(path).elements) == 4


def test_a_table_without_facts_that_becomes_a_log_says_what_is_not_known(path):
    (path.parent / "x.csv.json").unlink()
    assert read_csv(path).warnings == ()
    convert(path, path.with_suffix(".silo"))
    (warning,) = read_silo(path.with_suffix(".silo")).warnings
    assert warning == f"there was no 'x.csv.json' beside it: {UNKNOWN}"


def test_a_table_with_its_facts_becomes_a_log_without_a_word(path):
    convert(path, path.with_suffix(".silo"))
    again = read_silo(path.with_suffix(".silo"))
    assert again.warnings == ()
    assert facts_of(again) == facts_of(read_csv(path))


@pytest.mark.parametrize("key", ["first", "divider", "count"])
def test_ticks_that_no_integer_of_64_bits_holds_are_those_of_no_table(tmp_path, key):
    entry = RecordedEntry("/log/n", Entry("", "<i8"), np.arange(1))
    element = RecordedElement("/log/n", "-", "scalar", (), 1, BufferType.GROWING, 0, (entry,))
    path = tmp_path / "x.csv"
    write_csv(Recording("run", np.arange(1) * 10**9, 1, (element,)), path)
    facts = json.loads((tmp_path / "x.csv.json").read_bytes())
    facts["elements"][0][key] = 99999999999999999999
    (tmp_path / "x.csv.json").write_text(json.dumps(facts))
    assert "is not of this table" in read_csv(path).warnings[0]
