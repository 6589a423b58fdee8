"""CSV in both layouts: every value in full, what other tools read, and back."""

import csv
import io
import os
import re
import threading
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import silo
from silo.core.arguments import shown
from silo.core.elements import BufferType
from silo.errors import FileFormatError, LogNotFoundError
from silo.files.csv import writer
from silo.files.csv.reader import read_csv
from silo.files.csv.writer import write_csv
from tests.examples import examples
from tests.rows_csv import write_rows

QUICK = settings(max_examples=examples(80))
NUMBERS = ("<f8", "<f4", "<f2", "|i1", "<i2", "<i4", "<i8", "|u1", "<u2", "<u4", "<u8", "|b1", "<M8[ns]", "|S5", "<U4")


@pytest.fixture(params=["encoded", "plain"])
def way(request, monkeypatch):
    monkeypatch.setattr(writer, "ENCODED_FROM", 0 if request.param == "encoded" else 10**12)
    return request.param


def entries_of(recording):
    return {entry.name: (element, entry) for element in recording.elements for entry in element.entries}


def same_values(before, after, bits_of):
    if before.dtype.kind in "SU":
        return bits_of(before) == after.tolist()
    if before.dtype.kind in "mM":
        before = before.view("<i8")
    if before.dtype.kind == "f":
        # a NaN has no bits in a text, and a float is written in its own precision
        return np.array_equal(before, after.astype(before.dtype), equal_nan=True) and np.array_equal(
            np.signbit(before)[~np.isnan(before)], np.signbit(after.astype(before.dtype))[~np.isnan(before)]
        )
    return after.tolist() == before.astype("<u8" if before.dtype == np.dtype("<u8") else "<i8").tolist()


@pytest.mark.slow
@pytest.mark.parametrize("write", [write_csv, write_rows])
@pytest.mark.parametrize("plain", [True, False])
@QUICK
@given(data=st.data())
def test_everything_that_csv_can_hold_survives_a_round_trip(
    data, write, plain, any_recording, bits_of, tmp_path_factory
):
    recording = data.draw(any_recording(types=NUMBERS, names=st.text("ab c\"',#\n/é", max_size=8)))
    path = tmp_path_factory.mktemp("csv") / "x.csv"
    with pytest.MonkeyPatch.context() as patch:
        if not plain:
            patch.setattr(writer, "ENCODED_FROM", 0)
        write(recording, path)
    # the table alone, as other tools leave it
    (path.parent / "x.csv.json").unlink()
    again = read_csv(path)
    np.testing.assert_array_equal(again.time_ns, recording.time_ns)
    before, after = entries_of(recording), entries_of(again)
    assert list(after) == [name for name, (element, _) in before.items() if element.count]
    assert again.warnings == ()
    for name, (element, entry) in after.items():
        assert same_values(before[name][1].values, entry.values, bits_of), name
        assert element.stamp_indices.tolist() == before[name][0].stamp_indices.tolist()


def test_the_first_column_is_the_exact_time(plan, recorded, tmp_path, way):
    write_csv(recorded([plan("/log/a")], 2), tmp_path / "x.csv")
    lines = (tmp_path / "x.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["time", "1700000000.123456789", "1700000000.125456789"]


def test_ticks_without_a_sample_are_empty_cells(plan, recorded, tmp_path, way):
    plans = [plan("/log/a", "<i4", divider=3, size=2, buffer_type=BufferType.FIXED), plan("/log/b", "|S4", divider=2)]
    recording = recorded(plans, 6)
    recording.elements[1].entries[0].values[:] = [b"x", b"", b"y"]
    write_csv(recording, tmp_path / "x.csv")
    rows = [line.split(",")[1:] for line in (tmp_path / "x.csv").read_text().splitlines()[1:]]
    assert [cells[0] != "" for cells in rows] == [True, False, False, True, False, False]
    assert [cells[1] for cells in rows] == ['"x"', "", '""', "", '"y"', ""]


def test_a_text_that_reads_as_the_end_of_an_encoded_line_is_kept(plan, recorded, tmp_path, way):
    recording = recorded([plan("/log/a", "|S8"), plan("/log/b")], 3)
    texts = np.array([b"x]\n[y", b'","', b"]"], "S8")
    entry = replace(recording.elements[0].entries[0], values=texts)
    recording = replace(recording, elements=[replace(recording.elements[0], entries=(entry,)), recording.elements[1]])
    write_csv(recording, tmp_path / "x.csv")
    assert read_csv(tmp_path / "x.csv").elements[0].entries[0].values.tolist() == texts.tolist()


def test_a_log_longer_than_a_chunk_has_no_seam(plan, recorded, tmp_path, way, monkeypatch):
    monkeypatch.setattr(writer, "CHUNK_CELLS", 20)
    recording = recorded([plan("/log/a", size=90), plan("/log/b", "<i4", divider=7, size=12)], 100)
    write_csv(recording, tmp_path / "x.csv")
    entries = entries_of(read_csv(tmp_path / "x.csv"))
    for name, (element, entry) in entries_of(recording).items():
        np.testing.assert_array_equal(entries[name][1].values, entry.values)
        assert entries[name][0].first == element.first


def test_pandas_reads_it(plan, recorded, tmp_path, way):
    pandas = pytest.importorskip("pandas")
    recording = recorded([plan('/log/a,"b"', "<i4"), plan("/log/s", "|S4", divider=2)], 6)
    recording.elements[1].entries[0].values[:] = [b"x,y", b'"', b"12"]
    write_csv(recording, tmp_path / "x.csv")
    frame = pandas.read_csv(tmp_path / "x.csv")
    assert frame['/log/a,"b"'].tolist() == recording.elements[0].entries[0].values.tolist()
    assert frame["/log/s"].dropna().tolist() == ["x,y", '"', "12"]


def test_rows_have_the_shape_of_the_original(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", "|u1", size=2), plan("/log/b", "<i2", divider=2, size=2)], 8)
    write_rows(recording, tmp_path / "x.csv")
    rows = list(csv.reader(io.StringIO((tmp_path / "x.csv").read_text())))
    assert [row[0] for row in rows] == ["/log/time_s", "/log/time_ns", "/log/a", "/log/b"]
    # LOOPING rows are padded at the front, and every cell is followed by a comma
    assert {len(row) for row in rows} == {6}
    a, b = (element.entries[0].values.tolist() for element in recording.elements)
    assert rows[2][1:] == ["", "", str(a[0]), str(a[1]), ""]
    assert rows[3][1:] == [str(b[0]), "", str(b[1]), "", ""]


def test_a_fixed_buffer_that_filled_early_gives_a_full_row(plan, recorded, tmp_path):
    plans = [plan("/log/a", "<i4", buffer_type=BufferType.FIXED, size=2)]
    write_rows(recorded(plans, 9), tmp_path / "x.csv")
    rows = (tmp_path / "x.csv").read_text().splitlines()
    assert rows[2].count(",") == rows[0].count(",")


def test_long_double_keeps_its_precision(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", "<f16")], 4)
    write_csv(recording, tmp_path / "x.csv")
    texts = [line.split(",")[1] for line in (tmp_path / "x.csv").read_text().splitlines()[1:]]
    assert [np.longdouble(text) for text in texts] == recording.elements[0].entries[0].values.tolist()


def test_a_table_of_another_tool_is_read(tmp_path):
    (tmp_path / "x.csv").write_text("\ufefft,x,label\r\n0.5,1,on\r\n1.0,,off\r\n1.5,2.5,\r\n2.5,3,x\r\n")
    recording = read_csv(tmp_path / "x.csv")
    assert recording.time_ns.tolist() == [500_000_000, 1_000_000_000, 1_500_000_000, 2_500_000_000]
    x, label = (element.entries[0].values.tolist() for element in recording.elements)
    assert repr(x) == "[1.0, nan, 2.5, 3.0]"
    assert label == [b"on", b"off", b"", b"x"]


@pytest.mark.parametrize(
    ("cells", "values", "rows", "told"),
    [
        (["1", "null", "3"], [1, 3], [0, 2], ""),
        (["1.5", "NA", "n/a", "-inf"], [1.5, -np.inf], [0, 3], ""),
        (["true", "None", "False"], [True, False], [0, 2], ""),
        (["NA", "none"], [b"NA", b"none"], [0, 1], ""),
        (
            ["1", "x", "null", "4"],
            [b"1", b"x", b"null", b"4"],
            [0, 1, 2, 3],
            "2 of 4 cells are no numbers, the first is 'x'",
        ),
        (["1_2", "13", "5"], [b"1_2", b"13", b"5"], [0, 1, 2], "1 of 3 cells are no numbers, the first is '1_2'"),
        (["a", "7", "b"], [b"a", b"7", b"b"], [0, 1, 2], ""),
        (['"1"', '"2"'], [b"1", b"2"], [0, 1], ""),
    ],
)
@pytest.mark.parametrize("times", ["{}", '"{}"'])
def test_words_for_what_is_missing_leave_numbers_and_other_words_are_told(cells, values, rows, told, times, tmp_path):
    lines = [f"{times.format(at)},{cell}\n" for at, cell in enumerate(cells)]
    (tmp_path / "x.csv").write_text("time,x\n" + "".join(lines))
    read = read_csv(tmp_path / "x.csv")
    if times != "{}" and cells[0].startswith('"'):
        values = [1, 2]  # who quotes times quotes everything
    found = read.elements[0]
    assert list(read.warnings) == [f"column 'x' is taken as texts: {told}"] * bool(told)
    assert (found.entries[0].values.tolist(), found.stamp_indices.tolist()) == (values, rows)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time_s,x\n0,1\n1,2\n", {"x": [1, 2]}),
        ("time,x\n0,1\n1,2", {"x": [1, 2]}),
        ("time\n0\n1", {}),
        ("time,x,y\n0,1,5\n1,2,", {"x": [1, 2], "y": [5]}),  # its last cell is empty, and no end of a line follows
    ],
)
def test_a_small_table_is_read_to_its_last_line(tmp_path, text, expected):
    (tmp_path / "x.csv").write_text(text)
    recording = read_csv(tmp_path / "x.csv")
    assert {element.name: element.entries[0].values.tolist() for element in recording.elements} == expected
    assert (recording.time_ns.tolist(), recording.warnings) == ([0, 10**9], ())


def test_a_last_column_time_ns_that_tells_other_times_is_left_out_with_a_warning(tmp_path):
    (tmp_path / "x.csv").write_text("time,x,time_ns\n0,1,5\n1,2,6\n")
    recording = read_csv(tmp_path / "x.csv")
    assert [element.name for element in recording.elements] == ["x"]
    assert recording.time_ns.tolist() == [0, 10**9]
    assert recording.warnings == ("its last column, 'time_ns', is not 'time' in nanoseconds: it is left out",)


def test_lines_that_end_by_a_carriage_return_alone_are_lines(tmp_path):
    (tmp_path / "x.csv").write_bytes(b'time,x,"a,b"\r0,1,5\r1,2,6\r')
    recording = read_csv(tmp_path / "x.csv")
    found = {element.name: element.entries[0].values.tolist() for element in recording.elements}
    assert (recording.time_ns.tolist(), found) == ([0, 10**9], {"x": [1, 2], "a,b": [5, 6]})


def test_a_line_that_is_cut_off_is_told_and_left_out(plan, recorded, tmp_path):
    write_csv(recorded([plan("/log/a", "<i8"), plan("/log/b", "<i8")], 5), tmp_path / "x.csv")
    text = (tmp_path / "x.csv").read_text()
    (tmp_path / "x.csv").write_text(text[: text.rindex(",")])
    recording = read_csv(tmp_path / "x.csv")
    assert len(recording.time_ns) == 4
    assert "record 6 has 3 cells" in recording.warnings[0]


def test_a_row_that_is_cut_off_is_told_and_gives_its_whole_cells(plan, recorded, tmp_path):
    write_rows(recorded([plan("/log/a", "<i8"), plan("/log/b", "<i8")], 5), tmp_path / "whole.csv")
    whole, data = read_csv(tmp_path / "whole.csv"), (tmp_path / "whole.csv").read_bytes()
    values = {one.name: one.entries[0].values.tolist() for one in whole.elements}
    for size in range(data.index(b"\n/log/a") + 1, len(data) - 1):
        (tmp_path / "x.csv").write_bytes(data[:size])
        found = read_csv(tmp_path / "x.csv")
        assert [one.entries[0].values.tolist() for one in found.elements] == [
            values[one.name][: one.count] for one in found.elements
        ]
        assert ("its last row has no end" in str(found.warnings)) == (data[size - 1 : size] != b"\n")


@pytest.mark.parametrize("name", ["all_types", "looping_wrapped", "mixed_dividers", "time_buffer_full"])
def test_numbers_in_files_of_the_original_are_read(name, fixtures_folder):
    from silo.files.silo.reader import read_silo

    truth = read_silo(fixtures_folder / f"{name}.silo")
    entries = entries_of(read_csv(fixtures_folder / f"{name}.csv"))
    checked = 0
    for entry_name, (element, entry) in entries_of(truth).items():
        # 8-bit values are raw characters there, and the largest double is rounded to infinity
        numeric = entry.values.dtype.kind in "iuf" and entry.values.dtype.itemsize > 1
        if not numeric or entry_name.endswith("special"):
            continue
        again = entries[entry_name][1].values.astype(float)
        np.testing.assert_allclose(again, entry.values.astype(float), rtol=1e-4)
        assert entries[entry_name][0].first == element.first
        checked += 1
    assert checked > 15


@pytest.mark.parametrize(
    ("name", "cells", "step_ns"),
    [
        ("time", ("0", "0.5"), 500_000_000), ("time_s", ("1", "1.000000001"), 1), ("t", ("0", "2e-3"), 2_000_000),
        ("time_ms", ("0", "10"), 10_000_000), ("Time [ms]", ("0.25", "0.5"), 250_000), ("t_us", ("-1", "2.5"), 3500),
        ("timestamp (us)", ("1700000000000000", "1700000000000001"), 1000), ("stamp_ms", ("0", "1e1"), 10_000_000),
        ("time_min", ("0", "0.000000000001"), 0), ("time [h]", ("0", "0.0000000015"), 5400),
        ("days", ("0", "1"), 86400 * 10**9),
        ("time/ms", ("0", "1"), 1_000_000), ('"time, usec"', ("0", "1"), 1000), ("t_d", ("0", "1"), 10**9),
        ("TIME_MS", ("0", "1"), 1_000_000), ("stampMs", ("0", "1"), 1_000_000), ("t_millis", ("0", "1"), 1_000_000),
        ("minutes", ("0", "1e0"), 60 * 10**9), ("time_hours", ("-1", "0.5"), 5400 * 10**9),
        ("stamp_ns", ("1700000000000000000", "1700000000000000001"), 1), ("time_ns", ("0.0", "7.0"), 7),
        ("date", ("2026-11-28T10:00:00", "2026-11-28T10:00:01"), 10**9),
    ],
)  # fmt: skip
def test_the_name_of_the_time_says_its_unit(tmp_path, name, cells, step_ns):
    (tmp_path / "x.csv").write_text(f"{name},a\n{cells[0]},1\n{cells[1]},2\n")
    read = read_csv(tmp_path / "x.csv")
    assert np.diff(read.time_ns).tolist() == [step_ns]
    assert not read.warnings


@pytest.mark.parametrize(
    ("name", "cell", "words"),
    [
        ("%time", "1700000000000000000", r"\('%time'\) says '1700000000000000000', and in seconds that is not within "
         r"the years 1678 to 2262: if they are others, call it '%time_ns', '%time_us' or '%time_ms'"),
        ("stamp", "1.7e18", r"says '1\.7e18', and in seconds .* call it 'stamp_ns'"),
        ("t_ns", "9300000000000000000", r"says '9300000000000000000', and in nanoseconds that .* 2262$"),
    ],
)  # fmt: skip
def test_times_that_are_in_another_unit_are_told_with_how_to_name_it(tmp_path, name, cell, words):
    (tmp_path / "x.csv").write_text(f"{name},a\n1,1\n{cell},2\n")
    with pytest.raises(FileFormatError, match=words):
        read_csv(tmp_path / "x.csv")


def test_a_column_without_a_name_is_called_by_its_number(tmp_path):
    (tmp_path / "x.csv").write_text("time,a,\n0,1,5\n1,2,6\n")
    log = silo.open_log(tmp_path / "x.csv")
    assert {name: log[name].values.tolist() for name in log} == {"a": [1, 2], "column_3": [5, 6]}


@pytest.mark.parametrize(
    ("name", "cells", "unit"),
    [
        ("tau", "12", " in seconds"),
        ("a_ms", "12", " in milliseconds"),
        ("h", "12", " in seconds"),
        ("a", "2026", " in"),
        ("x" * 70 + "y" * 5000, "12", " in seconds"),
    ],
)
def test_a_first_column_that_is_not_called_like_a_time_is_told(tmp_path, name, cells, unit):
    (tmp_path / "x.csv").write_text(f"{name},b\n{cells[0]},1\n{cells[1]},2\n")
    (told,) = read_csv(tmp_path / "x.csv").warnings
    assert told.startswith(f"its first column, {shown(name)}, is taken as the time{unit}")
    assert len(told) < 300


@pytest.mark.parametrize("cells", [["", "NaN"], ['""', "NaT"], [" ", "null"]])
def test_records_without_a_time_are_left_out_and_told(tmp_path, cells):
    rows = ["0,1,5", "2,,5,6", f"{cells[0]},2,5", "1,3,", f"{cells[1]},4,5", "3,6,7"]
    (tmp_path / "x.csv").write_text("time_ms,a,b\n" + "\n".join(rows) + "\n")
    read = read_csv(tmp_path / "x.csv")
    assert read.time_ns.tolist() == [0, 1_000_000, 3_000_000]
    values = {element.name: element.entries[0].values.tolist() for element in read.elements}
    assert values["a"] == [1, 3, 6]
    assert [values["b"][0], values["b"][-1]] == [5, 7]
    assert "record 4, 6 has no time in the first column; 2 left out" in read.warnings


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        (("2026-01-02T00:00:00Z", "2026-01-02T00:00:01.5Z"), [0, 1500]),
        (("2026-01-02T01:00:00+01:00", "2026-01-01 22:30:00.25-0130"), [0, 250]),
        (("2026-01-02 00:00:00", "2026-01-02T02:00:00+02"), [0, 0]),
    ],
)
def test_times_with_a_zone_are_those_of_utc(tmp_path, times, expected):
    (tmp_path / "x.csv").write_text(f"time,a\n{times[0]},1\n{times[1]},2\n")
    begin = np.datetime64("2026-01-02", "ns").astype(int)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ((read_csv(tmp_path / "x.csv").time_ns - begin) // 10**6).tolist() == expected


def test_true_and_false_are_truths(tmp_path):
    (tmp_path / "x.csv").write_text("time,a,b,c\n0,True,true,True\n1,False,FALSE,False\n2,,true,maybe\n")
    values = {one.name: one.entries[0].values for one in read_csv(tmp_path / "x.csv").elements}
    assert (values["a"].dtype, values["a"].tolist()[:2]) == (bool, [True, False])
    assert (values["b"].dtype, values["b"].tolist()) == (bool, [True, False, True])
    assert values["c"].tolist() == [b"True", b"False", b"maybe"]


@pytest.mark.parametrize("sign", [";", "\t", "|"])
def test_other_signs_between_columns_are_told_with_the_way_out(tmp_path, sign):
    (tmp_path / "x.csv").write_text(f"time{sign}a\n0{sign}1,5\n")
    with pytest.raises(FileFormatError, match=f"set apart by {re.escape(repr(sign))}, not by ','.*to_csv"):
        read_csv(tmp_path / "x.csv")


def test_numbers_are_no_years(tmp_path):
    (tmp_path / "x.csv").write_text("time,a\n0,1\n2000,2\n2026-01-01,3\n")
    with pytest.raises(FileFormatError, match="holds no time in seconds: '2026-01-01'"):
        read_csv(tmp_path / "x.csv")


def test_what_is_no_table_is_an_error_that_names_the_file(tmp_path):
    (tmp_path / "x.csv").write_text("a,b\nx,1\n")
    with pytest.raises(FileFormatError, match=r"x\.csv.*first column \('a'\) holds no time"):
        read_csv(tmp_path / "x.csv")
    for text, told in (("", "it is empty"), ("\0" * 5000, "of value 0 alone"), ("\0\0\n1,2\n", "of value 0 alone")):
        (tmp_path / "x.csv").write_text(text)
        with pytest.raises(FileFormatError, match=told):
            read_csv(tmp_path / "x.csv")
    with pytest.raises(LogNotFoundError, match="no file"):
        read_csv(tmp_path / "none.csv")


@pytest.mark.parametrize("large", [False, True])
def test_other_readers_see_numbers_and_exact_nanoseconds(plan, recorded, tmp_path, monkeypatch, large):
    polars, pandas = pytest.importorskip("polars"), pytest.importorskip("pandas")
    monkeypatch.setattr(writer, "ENCODED_FROM", 0 if large else 10**9)
    recording = recorded([plan("/log/a", size=20), plan("/log/b", "<f4", size=20)], 20)
    for element in recording.elements:
        element.entries[0].values[3] = np.nan
    path = tmp_path / "x.csv"
    write_csv(recording, path)
    for frame in (polars.read_csv(path), pandas.read_csv(path)):
        assert np.asarray(frame["time_ns"]).tolist() == recording.time_ns.tolist()
        for name in ("/log/a", "/log/b"):
            assert np.asarray(frame[name]).dtype.kind == "f"
            assert np.isnan(np.asarray(frame[name])[3])


def test_times_of_a_table_that_went_through_doubles_are_exact_again(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a", size=20)], 20)
    path = tmp_path / "x.csv"
    write_csv(recording, path)
    head, *lines = path.read_text().splitlines()
    rounded = [",".join([repr(float(cells[0])), *cells[1:]]) for cells in (line.split(",") for line in lines)]
    path.write_text("\n".join([head, *rounded]) + "\n")
    again = read_csv(path)
    assert again.time_ns.tolist() == recording.time_ns.tolist()
    assert [element.name for element in again.elements] == ["/log/a"]
    moved = [",".join([str(float(cells[0]) + 5), *cells[1:]]) for cells in (line.split(",") for line in lines)]
    path.write_text("\n".join([head, *moved]) + "\n")
    assert abs(read_csv(path).time_ns - recording.time_ns - 5 * 10**9).max() < 1000


@pytest.mark.parametrize(
    "later", ["time,a\n0,9\n", "time,a\n" + "".join(f"{tick},{tick * 1000}\n" for tick in range(20_000))]
)
def test_a_table_that_is_written_anew_in_its_place_stays_what_it_was_when_it_was_opened(tmp_path, later):
    path = tmp_path / "table.csv"
    path.write_text("time,a\n" + "".join(f"{tick},{tick + 7}\n" for tick in range(20_000)))
    recording = read_csv(path)
    path.write_text(later)
    np.testing.assert_array_equal(recording.elements[0].entries[0].values, np.arange(20_000) + 7)


def test_a_pipe_is_read(tmp_path):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=["time,a\n0,1\n1,2\n"], daemon=True)
    writer.start()
    recording = read_csv(path)
    writer.join()
    assert recording.elements[0].entries[0].values.tolist() == [1, 2]


def test_a_row_that_is_too_long_is_told_by_its_number(plan, recorded, tmp_path):
    write_rows(recorded([plan("/log/a", "<i4"), plan("/log/b", "<i4"), plan("/log/c", "<i4")], 4), tmp_path / "x.csv")
    lines = (tmp_path / "x.csv").read_text().splitlines()
    lines[3] += "7,"
    (tmp_path / "x.csv").write_text("\n".join([*lines, ""]))
    found = read_csv(tmp_path / "x.csv")
    assert [text for text in found.warnings if "left out" in text] == ["row 4 has 5 cells for 4 ticks; it is left out"]
    assert [element.name for element in found.elements] == ["/log/a", "/log/c"]


@pytest.mark.parametrize(
    ("text", "names", "told"),
    [
        ('time,a,name\n0,1,5" pipe\n1,2,x\n2,3,y\n', ['5" pipe', "x", "y"], ""),
        ('time,name,a\n0,5" pipe,1\n1,6" pipe,2\n2,"x, y",3\n', ['5" pipe', '6" pipe', "x, y"], ""),
        ('time,a,name\n0,1,a""b\n1,2,"""x"""\n2,3,"y\nz"\n', ['a""b', '"x"', "y\nz"], ""),
        (
            'time,name,a\n0,"x,1\n1,y,2\n2,z,3\n',
            ["x", "y", "z"],
            "line 2, column 'name' has a quote that is never closed",
        ),
        ('time,a,name,5" pipe\n0,1,"x\n,",0\n1,2,y,0\n2,3,z,0\n', ["x\n,", "y", "z"], ""),
        ('time,"name,a\n0,x,1\n1,y,2\n2,z,3\n', ["x", "y", "z"], ""),
        ('time, "b,c", "name",a\n0,5,x,1\n1,2,y,2\n2,3,z,3\n', ["x", "y", "z"], ""),
        ('time,name,a\n0, "x, y",1\n1,y,2\n2,\t"z" ,3\n', ["x, y", "y", "z"], ""),
        ("time,name,a\n0,x,1\n1,y\0,2\n2,z,3\n", ["x", "y", "z"], "line 3, column 'name' has a byte of value 0"),
        ("time,name,a\n0,x,1\n1,y,2\n2,z,3\n7,7\0\n", ["x", "y", "z"], "line 5 has a byte of value 0"),
    ],
)
def test_a_quote_opens_a_cell_where_it_begins_one_and_swallows_no_lines(tmp_path, text, names, told):
    path = tmp_path / "x.csv"
    path.write_text(text)
    log = silo.open_log(path)
    assert [log["name"].values.tolist(), log["a"].values.tolist()] == [names, [1, 2, 3]]
    assert told in " ".join(log.warnings)
    assert bool(told) == bool(log.warnings)


@pytest.mark.parametrize("records", ['0,1\n"2"', '0,1"\n2'])
def test_records_of_other_lengths_make_no_record_together(tmp_path, records):
    (tmp_path / "x.csv").write_text(f"time,a,b\n{records}")
    with pytest.raises(FileFormatError, match="none of its records has 3 cells"):
        read_csv(tmp_path / "x.csv")
