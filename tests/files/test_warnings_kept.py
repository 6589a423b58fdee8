"""What is wrong with a log stands in every file, also in those that silo doesn't read again."""

import json
from dataclasses import replace

import numpy as np
import pytest

import silo
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.formats import FORMATS, writer_for
from tests.later import Later

h5py, parquet, scipy_io = Later("h5py"), Later("pyarrow.parquet"), Later("scipy.io")

START = 1_700_000_000_000_000_000
TOLD = ("/log/x: nobody but silo holds this array any more", "12 samples were lost", "einmal ü, \0 und \n")


def of_parquet(path):
    return json.loads(parquet.read_metadata(path).metadata.get(b"warnings", b"[]"))


def of_hdf5(path):
    with h5py.File(path) as store:
        return [text.decode() for text in store["warnings"][:]] if "warnings" in store else []


def of_matlab(path):
    found = scipy_io.loadmat(path, simplify_cells=True)["silo"].get("warnings", [])
    return [found] if isinstance(found, str) else [str(text) for text in found]


def of_numpy(path):
    return json.loads(str(np.load(path)["silo.json"]))["warnings"]


READERS = {".parquet": of_parquet, ".h5": of_hdf5, ".mat": of_matlab, ".npz": of_numpy}


def recording(warnings=(), stamps=None):
    values = np.arange(10.0)
    stamps = START + np.arange(10) * 10_000_000 if stamps is None else stamps
    entries = (RecordedEntry("/log/x", Entry("", "<f8"), values),)
    element = RecordedElement("/log/x", "-", "scalar", (), 1, BufferType.GROWING, 0, entries)
    return Recording("run", stamps, 10, (element,), warnings=warnings)


def test_every_format_that_is_only_written_is_looked_at():
    rerun = {".rrd"}  # test_datasets.py, where its large package is installed
    assert set(READERS) | rerun == {one.ending for one in FORMATS if one.writer and not one.for_logs}


@pytest.mark.parametrize("ending", READERS)
@pytest.mark.parametrize("count", [0, 1, 3])
def test_warnings_of_a_log_stand_in_the_file(tmp_path, ending, count):
    path = tmp_path / f"run{ending}"
    writer_for(path)(recording(TOLD[:count]), path, None)
    found = READERS[ending](path)
    assert [text.replace("\0", "_") for text in found] == [text.replace("\0", "_") for text in TOLD[:count]]


@pytest.mark.parametrize("ending", READERS)
def test_a_clock_that_stepped_back_stands_in_the_file(tmp_path, ending):
    stamps = START + np.array([0, 1, 2, 3, 4, 2, 3, 4, 5, 6]) * 10_000_000
    path = tmp_path / f"run{ending}"
    writer_for(path)(recording(stamps=stamps), path, None)
    (told,) = READERS[ending](path)
    assert told.startswith("the clock stepped back once, first by 0.02 s at 0.04 s")


@pytest.mark.parametrize("ending", READERS)
@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_what_a_saved_log_told_is_told_by_what_is_made_of_it(tmp_path, ending):
    first = tmp_path / "run.silo"
    writer_for(first)(replace(recording(TOLD[:2])), first, None)
    path = silo.open_log(first).save(tmp_path / f"run{ending}")
    assert READERS[ending](path) == list(TOLD[:2])


@pytest.mark.parametrize("ending", READERS)
def test_an_element_of_that_name_has_its_place(tmp_path, ending):
    values = np.arange(3.0)
    entries = (RecordedEntry("/warnings", Entry("", "<f8"), values),)
    element = RecordedElement("/warnings", "-", "scalar", (), 1, BufferType.GROWING, 0, entries)
    path = tmp_path / f"run{ending}"
    writer_for(path)(Recording("run", START + np.arange(3), 3, (element,), warnings=TOLD[:1]), path, None)
    assert READERS[ending](path) == list(TOLD[:1])
