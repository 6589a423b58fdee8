"""Tables of numbers are read by polars; what comes of them is the same as cell by cell."""

import numpy as np
import pytest

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.csv import numbers
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


@pytest.fixture(params=["quick", "cell by cell"])
def reader(request, monkeypatch):
    monkeypatch.setattr(numbers, "SMALLEST", 0 if request.param == "quick" else 10**12)
    return request.param


@pytest.fixture
def taken(monkeypatch):
    """Whether the quick way was taken."""
    found = []
    known = numbers.read_numbers

    def noted(*arguments):
        found.append(known(*arguments))
        return found[-1]

    monkeypatch.setattr("silo.files.csv.reader.read_numbers", noted)
    monkeypatch.setattr(numbers, "SMALLEST", 0)
    return lambda: found[-1] is not None


def same(one, other):
    return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind in "fM")


def test_a_log_comes_back_bit_for_bit(reader, tmp_path):
    written = recording(plain_numbers())
    write_csv(written, tmp_path / "x.csv")
    read = read_csv(tmp_path / "x.csv")
    assert read.time_ns.tolist() == written.time_ns.tolist()
    for mine, theirs in zip(read.elements, written.elements, strict=True):
        assert same(mine.entries[0].values, theirs.entries[0].values), mine.name
        assert (mine.first, mine.divider, mine.unit) == (theirs.first, theirs.divider, "m")


def test_a_log_of_numbers_takes_the_quick_way(taken, tmp_path):
    write_csv(recording(plain_numbers()), tmp_path / "x.csv")
    read_csv(tmp_path / "x.csv")
    assert taken()


TABLES = {
    "floats": "time,a,b\n" + "".join(f"{k / 10},{k / 3},{-k}e-5\n" for k in range(20)),
    "whole numbers and a divider": "time,a,b\n" + "".join(f"{k},{k},{k if k % 2 == 0 else ''}\n" for k in range(20)),
    "no line feed at the end": "time,a\n0,1.5\n1,2.5",
    "blank lines": "time,a\n0,1.5\n\n1,2.5\n\n",
    "carriage returns": "time,a\r\n0,1.5\r\n1,2.5\r\n",
    "one carriage return": "time,a\n0,1.5\n1,2.5\r\n2,3.5\n",
    "a short line": "time,a,b\n0,1,2\n1,3\n2,5,6\n",
    "a long line": "time,a,b\n0,1,2\n1,3,4,5\n2,5,6\n",
    "a short and a long line": "time,a,b\n0,1,2\n1,3\n2,5,6,7\n",
    "cut off": "time,a,b\n0,1,2\n1,3,4\n2,5",
    "texts": "time,a,b\n0,1,walk\n1,2,stand\n",
    "quoted numbers": 'time,a\n0,"1"\n1,"2"\n',
    "a quoted comma": 'time,a,b\n0,"1,5",2\n1,"2",3\n',
    "gaps": "time,a\n0,1.5\n1,\n2,\n3,2.5\n4,1\n",
    "an empty column": "time,a,b\n0,,1\n1,,2\n",
    "nan and inf": "time,a\n0,nan\n1,inf\n2,-inf\n3,1\n",
    "large integers": "time,a,b\n0,18446744073709551615,9007199254740993\n1,1,2\n",
    "large integers among floats": "time,a\n0,0.5\n1,9007199254740993\n",
    "floats after many integers": "time,a\n" + "".join(f"{k},{k}\n" for k in range(300)) + "300,0.5\n",
    "a text after many numbers": "time,a\n" + "".join(f"{k},{k}\n" for k in range(300)) + "300,x\n",
    "underscores": "time,a\n0,1_000\n1,2\n",
    "blanks": "time,a\n0, 1\n1,2 \n",
    "truths": "time,a\n0,true\n1,false\n",
    "a mark at the begin": "\ufefftime,a\n0,1\n1,2\n",
    "dates": "time,a\n2026-01-01T00:00:00,1\n2026-01-01T00:00:01,2\n",
    "only a head": "time,a\n",
    "too large": "time,a\n0,1e400\n1,2\n",
    "a vector": "time,/log/q_x,/log/q_y,/log/q_z\n0,1.5,2,3\n1,4,5,6\n",
}


@pytest.mark.parametrize("table", TABLES)
def test_tables_of_others_are_read_alike_in_both_ways(table, tmp_path, monkeypatch):
    path = tmp_path / "x.csv"
    path.write_bytes(TABLES[table].encode())
    found = []
    for smallest in (0, 10**12):
        monkeypatch.setattr(numbers, "SMALLEST", smallest)
        found.append(read_csv(path))
    quick, slow = found
    assert quick.warnings == slow.warnings
    assert quick.time_ns.tolist() == slow.time_ns.tolist()
    assert [e.name for e in quick.elements] == [e.name for e in slow.elements]
    for mine, theirs in zip(quick.elements, slow.elements, strict=True):
        assert (mine.kind, mine.first, mine.divider) == (theirs.kind, theirs.first, theirs.divider)
        for one, other in zip(mine.entries, theirs.entries, strict=True):
            assert same(one.values, other.values), (one.values, other.values)
