"""Tables of silo and of others, each read as they were cell by cell, before all cells were found at once."""

import json
from pathlib import Path

import numpy as np
import pytest

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import FileFormatError
from silo.files.csv import cells as reading_cells
from silo.files.csv import writer
from silo.files.csv.reader import read_csv
from silo.files.csv.writer import write_csv


def recording(columns, ticks=300):
    """A log of columns: name -> values; those with fewer than `ticks` values have a divider."""
    elements = []
    for name, values in columns.items():
        entry = RecordedEntry(name, Entry("", values.dtype.str), values)
        divider = ticks // len(values)
        elements.append(RecordedElement(name, "m", "scalar", (), divider, BufferType.GROWING, 0, (entry,)))
    time_ns = 1_700_000_000_123_456_789 + np.arange(ticks, dtype=np.int64) * 2_000_003
    return Recording("fast", time_ns, ticks, tuple(elements))


def random_bits(dtype, count=300):
    kind = np.dtype(dtype)
    return np.frombuffer(np.random.default_rng(1).bytes(count * kind.itemsize), kind)


def plain_numbers():
    floats = random_bits("f8").copy()
    floats[:6] = [np.nan, np.inf, -np.inf, -0.0, 5e-324, np.finfo(float).max]
    with np.errstate(invalid="ignore"):
        narrow = random_bits("f4").copy()
    return {
        "/log/f8": floats,
        "/log/f4": narrow,
        "/log/f2": random_bits("f2").copy(),
        "/log/i8": random_bits("i8"),
        "/log/u8": random_bits("u8"),
        "/log/i1": random_bits("i1"),
        "/log/b": random_bits("u1") > 100,
        "/log/slow": np.arange(60.0) / 7,
        "/log/when": random_bits("i8").view("M8[ns]"),
    }


def same(one, other):
    return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind in "fM")


@pytest.mark.parametrize("encoded_from", [0, 10**12])
def test_a_log_comes_back_bit_for_bit(encoded_from, tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "ENCODED_FROM", encoded_from)
    written = recording(plain_numbers())
    write_csv(written, tmp_path / "x.csv")
    read = read_csv(tmp_path / "x.csv")
    assert read.time_ns.tolist() == written.time_ns.tolist()
    for mine, theirs in zip(read.elements, written.elements, strict=True):
        assert same(mine.entries[0].values, theirs.entries[0].values), mine.name
        assert (mine.first, mine.divider, mine.unit) == (theirs.first, theirs.divider, "m")


TABLES = json.loads((Path(__file__).parents[1] / "data" / "csv_tables.json").read_text())


@pytest.mark.parametrize("table", TABLES)
def test_tables_of_others_are_read_as_ever(table, tmp_path):
    told, path = TABLES[table], tmp_path / "x.csv"
    path.write_bytes(told["text"].encode())
    if "error" in told:
        with pytest.raises(FileFormatError):
            read_csv(path)
        return
    read = read_csv(path)
    said = [(one.count, [str(entry.dtype.kind) for entry in one.entries]) for one in read.elements]
    assert [*read.warnings] == told["warnings"]
    assert read.time_ns.tolist() == told["time_ns"]
    assert [
        {
            **{name: getattr(one, name) for name in ("name", "kind", "first", "divider", "count")},
            "entries": [
                {"name": entry.name, "dtype": str(entry.values.dtype), "values": repr(entry.values.tolist())}
                for entry in one.entries
            ],
        }
        for one in read.elements
    ] == told["elements"]
    assert said == [(one.count, [str(entry.dtype.kind) for entry in one.entries]) for one in read.elements]


def test_a_text_far_down_in_a_column_of_numbers_makes_it_a_column_of_texts(tmp_path):
    lines = [f"{k},{k},{k / 3}" for k in range(2000)]
    lines[1237] = "1237,x,y.5"
    (tmp_path / "x.csv").write_text("\n".join(["time,a,b", *lines]))
    a, b = read_csv(tmp_path / "x.csv").elements
    assert (a.entries[0].dtype.kind, b.entries[0].dtype.kind) == ("S", "S")
    assert (a.entries[0].values[1237], b.entries[0].values[1237]) == (b"x", b"y.5")


def test_a_value_that_its_type_cannot_be_is_told_when_it_is_read(tmp_path):
    write_csv(recording({"/log/a": np.arange(300, dtype="i1")}), tmp_path / "x.csv")
    text = (tmp_path / "x.csv").read_text().replace(",5,", ",300,", 1)
    (tmp_path / "x.csv").write_text(text)
    (element,) = read_csv(tmp_path / "x.csv").elements
    with pytest.raises(FileFormatError, match=r"x\.csv: '/log/a' was logged as \|i1, which a value"):
        _ = element.entries[0].values


SEVENS = ["7"] * 4000


@pytest.mark.parametrize(
    "cells",
    [
        pytest.param(["2024-01-01", "2024-01-02"], id="dates"),
        pytest.param(["-", "5"], id="missing"),
        pytest.param(["1.2.3", "4.5.6"], id="versions"),
        pytest.param(["een", "nine"], id="letters of numbers"),
        pytest.param([*SEVENS, "7.5", *SEVENS], id="one point of many"),
        pytest.param([*SEVENS, "3/4", *SEVENS], id="one slash of many"),
        pytest.param(["-5", "7"], id="signs"),
        pytest.param(["5", "7"], id="figures"),
    ],
)
def test_a_column_is_told_as_the_type_that_its_values_have(cells, tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("time,x\n" + "".join(f"{tick},{cell}\n" for tick, cell in enumerate(cells)))
    entry = read_csv(path).elements[0].entries[0]
    assert entry.dtype == entry.values.dtype.str


@pytest.mark.parametrize("piece", [4, 8, 11, 1 << 20])
@pytest.mark.parametrize("last", ['"never closed', "closed"])
def test_a_name_of_two_lines_is_one_whatever_is_never_closed_far_below(last, piece, tmp_path, monkeypatch):
    monkeypatch.setattr(reading_cells, "_PIECE", piece)
    (tmp_path / "x.csv").write_text(f'"t\nime","a\nb"\n0,1\n1,{last}\n')
    read = read_csv(tmp_path / "x.csv")
    assert [element.name for element in read.elements] == ["a\nb"]
    assert read.time_ns.tolist() == [0, 10**9]


def test_a_line_without_end_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(reading_cells, "_LONGEST_LINE", 1 << 20)
    (tmp_path / "x.csv").write_bytes(b"a" * (3 << 20))
    with pytest.raises(FileFormatError, match="the line that begins at byte 0 has no end within 1,048,576 bytes"):
        read_csv(tmp_path / "x.csv")
