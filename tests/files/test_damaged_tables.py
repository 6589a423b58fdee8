"""Parquet, HDF5 and NumPy files that were damaged or made up: no value is another one without a word."""

import zipfile

import numpy as np
import pytest

import silo
from silo.core.recording import Recording
from silo.errors import FileFormatError, SiloError
from silo.files.tables import facts, matlab_variables
from silo.files.tables.arrays import write_hdf5, write_mat, write_npz
from silo.files.tables.parquet import write_parquet
from tests.stand_ins import saved

TICKS = 400
VALUES = np.random.default_rng(3).random(TICKS)
WRITERS = {".parquet": write_parquet, ".h5": write_hdf5, ".npz": write_npz, ".mat": write_mat}


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
    for number, place in enumerate(rng.integers(0, len(data), 150).tolist()):
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        path = tmp_path / f"{number}{ending}"  # what is open still is another file
        path.write_bytes(damaged)
        try:
            log = silo.open_log(path)
            assert np.array_equal(log["x"].values, VALUES)
            assert np.array_equal(log["x"].time_ns, 10**18 + 10**6 * np.arange(TICKS))
        except SiloError:
            refused += 1
    assert refused > 30  # a third of the file and more are values


@pytest.mark.parametrize("ending", WRITERS)
def test_what_a_file_says_of_its_log_is_what_was_written(tmp_path, monkeypatch, ending):
    packed = facts.packed
    monkeypatch.setattr(f"silo.files.tables.{'parquet' if ending == '.parquet' else 'arrays'}.packed", lambda *given: (
        packed(*given).replace('"count":400', '"count":0')
    ))  # fmt: skip
    with pytest.raises(FileFormatError, match="is damaged: what it says of its log is not what was written"):
        silo.open_log(written(tmp_path, ending))
    monkeypatch.setattr(f"silo.files.tables.{'parquet' if ending == '.parquet' else 'arrays'}.packed", lambda *given: (
        packed(*given).rpartition(',"crc32"')[0] + "}"  # as silo before 0.5 wrote
    ))  # fmt: skip
    assert len(silo.open_log(written(tmp_path, ending))["x"]) == 400


@pytest.mark.parametrize(
    ("name", "array", "words"),
    [
        ("log/x", np.zeros(2**21), r"'log/x' has the shape \(2097152,\), not \(400,\)"),
        ("log/x", np.zeros((TICKS, 1000)), r"'log/x' has the shape \(400, 1000\), not \(400,\)"),
        ("log/x", np.zeros(TICKS, "S10000"), "the values of 'log/x' have 10,000 bytes each, not 8"),
        ("silo.log", np.zeros(9), r"'silo.log' has the shape \(9,\), not \(\)"),
    ],
)
def test_an_array_of_another_size_is_refused_before_it_is_unpacked(tmp_path, monkeypatch, name, array, words):
    path, whole = tmp_path / "bomb.npz", written(tmp_path, ".npz")
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for each in source.namelist():
            with target.open(each, "w") as member:
                if each == f"{name}.npy":
                    np.lib.format.write_array(member, array)
                else:
                    member.write(source.read(each))
    sizes = []

    def read_array(file, *more, read=np.lib.format.read_array, **named):
        found = read(file, *more, **named)
        sizes.append(found.nbytes)
        return found

    monkeypatch.setattr(np.lib.format, "read_array", read_array)
    with pytest.raises(SiloError, match=words):
        _ = silo.open_log(path)["x"].values
    assert array.nbytes not in sizes


def test_a_variable_of_mat_that_unpacks_to_more_than_its_samples_is_not_unpacked(tmp_path, monkeypatch):
    import scipy.io

    path, whole = tmp_path / "bomb.mat", written(tmp_path, ".mat")
    held = scipy.io.loadmat(whole)
    held["log_x"]["data"][0, 0] = np.zeros((2_000_000, 1))
    kept = {name: value for name, value in held.items() if not name.startswith("__")}
    scipy.io.savemat(path, kept, do_compression=True, long_field_names=True, oned_as="column")
    unpacked, loadmat = [], scipy.io.loadmat
    monkeypatch.setattr(scipy.io, "loadmat", lambda file, **more: unpacked.append(file) or loadmat(file, **more))
    with pytest.raises(silo.SiloError, match=r"'log_x' has more than the [\d,]+ bytes that it may have"):
        _ = silo.open_log(path)["x"].values
    assert len(unpacked) == 1  # what the log says of itself


def test_one_without_a_log_is_unpacked_to_a_bound_too(tmp_path, monkeypatch):
    import scipy.io

    monkeypatch.setattr(matlab_variables, "MOST_ROOM", 2**20)
    monkeypatch.setattr(matlab_variables, "MOST_RATIO", 2)
    path = tmp_path / "bomb.mat"
    scipy.io.savemat(path, {"silo": {"log": "{}", "time_ns": np.zeros(2_000_000)}}, do_compression=True)
    with pytest.raises(silo.SiloError, match="'silo' has more than the 1,048,576 bytes that it may have"):
        silo.open_log(path)
