"""Parquet, HDF5 and NumPy files that were damaged or made up: no value is another one without a word."""

import zipfile

import numpy as np
import pytest

import silo
from silo.core.recording import Recording
from silo.errors import SiloError
from silo.files.tables.arrays import write_hdf5, write_npz
from silo.files.tables.parquet import write_parquet
from tests.stand_ins import saved

TICKS = 400
VALUES = np.random.default_rng(3).random(TICKS)
WRITERS = {".parquet": write_parquet, ".h5": write_hdf5, ".npz": write_npz}


def written(folder, ending):
    path = folder / f"log{ending}"
    times = 10**18 + 10**6 * np.arange(TICKS, dtype=np.int64)
    elements = [saved.element("/log/x", [VALUES], "m"), saved.element("/log/none", [np.zeros(0)], "m")]
    WRITERS[ending](Recording("bot", times, TICKS, elements), path)
    return path


@pytest.mark.parametrize("ending", WRITERS)
def test_of_a_file_with_a_bit_turned_no_value_is_another_one(tmp_path, ending):
    path = written(tmp_path, ending)
    data, rng = path.read_bytes(), np.random.default_rng(5)
    refused = 0
    for place in rng.integers(0, len(data), 150).tolist():
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            log = silo.open_log(path)
            assert np.array_equal(log["x"].values, VALUES)
            assert np.array_equal(log["x"].time_ns, 10**18 + 10**6 * np.arange(TICKS))
        except SiloError:
            refused += 1
    assert refused > 30  # a third of the file and more are values


def test_an_array_of_another_length_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    path, whole = tmp_path / "bomb.npz", written(tmp_path, ".npz")
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            with target.open(name, "w") as member:
                if name == "log/x.npy":
                    np.lib.format.write_array(member, np.zeros(2**21))
                else:
                    member.write(source.read(name))
    log, read = silo.open_log(path), []
    monkeypatch.setattr(np.lib.format, "read_array", lambda *_, **__: read.append(1))
    with pytest.raises(SiloError, match=r"'log/x' has the shape \(2097152,\), not 400 samples"):
        _ = log["x"].values
    assert not read
