"""What is missing of a type without NaN stays missing in every format: no number stands there that nobody wrote."""

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import silo
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.formats import read_recording
from tests.later import Later

h5py, polars, parquet, scipy_io = map(Later, ("h5py", "polars", "pyarrow.parquet", "scipy.io"))

START = 1_700_000_000_000_000_000
STEP = 10_000_000
LARGE = 2**53 + 1
FORMATS = (".silo", ".csv", ".mcap", ".rosbag2")


@pytest.fixture
def bag(tmp_path):
    """A bag of others: keys of JSON that come late, are missing now and then, and lists of changing length."""
    path = tmp_path / "others.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("J", "jsonschema", b"{}")
        topic = writer.register_channel("/j", "json", schema)
        for at in range(12):
            row = {"y": at, "list": list(range(1 + at % 3))}
            row |= {"small": at * 3, "large": LARGE + at, "on": at % 2 == 0} if at >= 4 and at != 7 else {}
            stamp = START + at * STEP
            writer.add_message(topic, stamp, json.dumps(row).encode(), stamp)
        writer.finish()
    return path


@pytest.fixture
def log(bag):
    found = silo.open_log(bag)
    return found.resample(found["j/y"])


def expected(name):
    there = [at >= 4 and at != 7 for at in range(12)]
    values = {"small": [at * 3 for at in range(12)], "large": [LARGE + at for at in range(12)]}
    values |= {"on": [at % 2 == 0 for at in range(12)]}
    return [value if is_there else None for value, is_there in zip(values[name], there, strict=True)]


LISTS = [[0, None, None], [0, 1, None], [0, 1, 2]] * 4


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("name", ["small", "large", "on"])
def test_a_key_that_comes_late_is_missing_before_in_every_format_that_is_read(log, tmp_path, ending, name):
    found = silo.open_log(log.save(tmp_path / f"run{ending}"))[f"j/{name}"]
    assert found.values.tolist() == expected(name)
    assert found.values.dtype == (bool if name == "on" else np.int64)


@pytest.mark.parametrize("ending", FORMATS)
def test_lists_that_are_shorter_are_missing_at_their_ends(log, tmp_path, ending):
    found = silo.open_log(log.save(tmp_path / f"run{ending}"))["j/list"]
    assert found.values.tolist() == LISTS
    assert found.dtype == np.int64


def test_a_column_of_doubles_has_nan_for_every_reader_of_silo_files(log, tmp_path):
    path = log.save(tmp_path / "run.silo")
    head = path.read_bytes().split(b"# Binary Data")[0].decode()
    assert "/j/small 8 12 1 0 double" in head
    assert "/j/on 8 12 1 0 double" in head
    assert "/j/large 8 12 1 0 int64" in head  # doubles can't hold them: the lowest number says that they are missing
    assert str(-(2**63)) in head


def test_damaged_headers_keep_what_is_missing(log, tmp_path):
    path = log.save(tmp_path / "run.silo")
    path.write_bytes(path.read_bytes() + b"abc")  # no longer what silo wrote: it is repaired
    with pytest.warns(silo.LogWarning, match="3 bytes after"):
        found = silo.open_log(path)
    assert found["j/large"].values.tolist() == expected("large")
    assert found["j/small"].values.tolist() == expected("small")


def test_csv_without_its_sidecar_keeps_integers_and_what_is_missing(log, tmp_path):
    path = log.save(tmp_path / "run.csv")
    (tmp_path / "run.csv.json").unlink()
    assert silo.open_log(path)["j/large"].values.tolist() == expected("large")


def test_a_large_csv_is_written_by_polars_with_empty_cells(tmp_path):
    values = np.ma.masked_array(np.arange(150_000) + LARGE, np.arange(150_000) % 7 == 0)
    path = recording(values).save(tmp_path / "run.csv")
    again = silo.open_log(path)["x"].values
    assert (np.ma.getmaskarray(again) == np.ma.getmaskarray(values)).all()
    assert np.ma.allequal(again, values)


def test_bags_have_no_message_where_all_of_it_is_missing(log, tmp_path):
    path = log.save(tmp_path / "run.mcap")
    with path.open("rb") as file:
        stamps = [message.log_time for _, channel, message in make_reader(file).iter_messages(topics=["/j/large"])]
    assert stamps == [START + at * STEP for at, value in enumerate(expected("large")) if value is not None]


def test_parquet_has_null(log, tmp_path):
    table = parquet.read_table(log.save(tmp_path / "run.parquet"))
    for name in ("small", "large", "on"):
        assert table[f"/j/{name}"].to_pylist() == expected(name)
    assert [table[f"/j/list_{at}"].to_pylist() for at in range(3)] == [list(one) for one in zip(*LISTS, strict=True)]


def test_hdf5_has_a_fill_value_that_no_sample_is(log, tmp_path):
    with h5py.File(log.save(tmp_path / "run.h5")) as store:
        for name in ("small", "large", "on"):
            values = store[f"j/{name}/values"]
            fill = values.attrs["_FillValue"]
            assert [None if each == fill else int(each) for each in values[:]] == expected(name)
        lists = store["j/list/values"]
        assert [[None if v == lists.attrs["_FillValue"] else int(v) for v in row] for row in lists[:]] == LISTS


def test_matlab_has_nan_and_a_number_of_its_own_where_doubles_are_too_coarse(log, tmp_path):
    structs = scipy_io.loadmat(log.save(tmp_path / "run.mat"), simplify_cells=True)
    small = structs["j_small"]["data"]
    assert [None if np.isnan(each) else int(each) for each in small] == expected("small")
    large = structs["j_large"]
    assert [None if each == large["missing"] else int(each) for each in large["data"]] == expected("large")
    lists = structs["j_list"]["data"]
    assert [[None if np.isnan(each) else int(each) for each in row] for row in lists] == LISTS


def test_npz_says_which_are_missing(log, tmp_path):
    arrays = np.load(log.save(tmp_path / "run.npz"))
    for name in ("small", "large", "on"):
        values = np.ma.masked_array(arrays[f"j/{name}"], arrays[f"j/{name}.missing"])
        assert values.tolist() == expected(name)
        assert arrays[f"j/{name}"][0] not in expected(name)


def recording(*columns, divider=1, first=0):
    """A log of one element, an entry for each column."""
    entries = tuple(
        RecordedEntry(f"/log/x{suffix}", Entry(suffix, column.dtype.str), column)
        for at, column in enumerate(columns)
        for suffix in [f"_{at}" if len(columns) > 1 else ""]
    )
    shape = (len(columns),) if len(columns) > 1 else ()
    kind = "vector" if shape else "scalar"
    element = RecordedElement("/log/x", "-", kind, shape, divider, BufferType.GROWING, first, entries)
    ticks = first + len(columns[0]) * divider
    return silo.Log(Recording("run", START + np.arange(ticks) * STEP, ticks, (element,)))


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i4", "u8", "i8"])
@pytest.mark.parametrize("ending", FORMATS)
def test_every_number_of_a_type_can_be_a_sample(tmp_path, ending, dtype):
    limits = np.iinfo(dtype)
    numbers = list(range(limits.min, limits.max + 1)) if limits.bits == 8 else [limits.min, limits.max, 0]
    values = np.ma.masked_array(np.array([*numbers, 0], dtype), [*[False] * len(numbers), True])
    found = silo.open_log(recording(values).save(tmp_path / f"run{ending}"))["x"].values
    assert found.tolist() == [*numbers, None]
    assert found.dtype == np.dtype(dtype)


@pytest.mark.parametrize("ending", FORMATS)
def test_dividers_and_first_ticks_stay_with_missing_samples(tmp_path, ending):
    values = np.ma.masked_array(np.arange(1000), np.arange(1000) % 3 == 0)
    log = recording(values, values + 5, divider=4, first=7)
    again = read_recording(log.save(tmp_path / f"run{ending}"))
    (element,) = again.elements
    assert (element.first, element.divider, element.count) == (7, 4, 1000)
    assert [entry.values.tolist() for entry in element.entries] == [values.tolist(), (values + 5).tolist()]


@pytest.mark.parametrize("ending", (*FORMATS, ".npz"))
def test_raw_bytes_that_are_missing_are_no_zeros(tmp_path, ending):
    raw = np.array([bytes([at, 0, 255 - at]) for at in range(12)], "V3")
    missing = np.isin(np.arange(12), (0, 4, 5, 11))
    kept = silo.open_log(recording(np.ma.masked_array(raw, missing)).save(tmp_path / f"run{ending}"))
    again = silo.open_log(kept.save(tmp_path / f"again{ending}"))  # as they are read, they are written
    for found in (kept["x"].values, again["x"].values):
        assert np.ma.getmaskarray(found).tolist() == missing.tolist()
        assert np.ma.getdata(found)[~missing].tobytes() == raw[~missing].tobytes()
