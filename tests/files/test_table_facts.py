"""What files of arrays say of themselves is held against what is in them, and told in one line."""

import zipfile
from dataclasses import replace
from io import BytesIO

import msgspec
import numpy as np
import pytest

from silo.errors import FileFormatError
from silo.files.tables.arrays import read_npz, write_npz
from silo.files.tables.facts import NAME, told_of


@pytest.fixture
def changed(plan, recorded, tmp_path):
    """What makes a file of a log in which an element has stamps of its own, its arrays and facts changed."""

    def make(**changes):
        recording = recorded([plan("/log/a"), plan("/log/b")], 5)
        own = replace(recording.elements[1], own_ns=recording.time_ns + 7)
        path = tmp_path / "x.npz"
        write_npz(replace(recording, elements=(recording.elements[0], own)), path)
        arrays = dict(np.load(path))
        facts = msgspec.json.decode(str(arrays[NAME]))
        for name, change in changes.items():
            if name in facts:
                facts[name] = change(facts[name])
            else:
                arrays[name] = change(arrays[name])
        del facts["crc32"]
        arrays[NAME] = np.array(msgspec.json.encode(facts).decode())
        with zipfile.ZipFile(path, "w") as archive:
            for name, values in arrays.items():
                np.save(member := BytesIO(), values)
                archive.writestr(f"{name}.npy", member.getvalue())
        return path

    return make


def test_stamps_of_its_own_are_read_with_their_element(changed):
    element = read_npz(changed()).elements[1]
    assert len(element.own_ns) == element.count == 5


@pytest.mark.parametrize("change", [lambda own: own[:3], lambda own: np.append(own, own)])
def test_stamps_of_its_own_that_are_not_as_many_as_its_samples_are_an_error(changed, change):
    path = changed(**{"log/b.time_ns": change})
    with pytest.raises(FileFormatError, match=r"'log/b.time_ns' has the shape \((3|10),\), not \(5,\)"):
        read_npz(path)


@pytest.mark.parametrize("change", [lambda places: places[:1], lambda places: places * 2])
def test_places_that_are_not_as_many_as_the_entries_are_an_error_that_says_so(changed, change):
    path = changed(places=change)
    with pytest.raises(FileFormatError, match=r"says where (1|4) entries stand, and has 2: it is damaged"):
        read_npz(path)


def test_the_words_of_a_library_end_without_a_line_break(tmp_path):
    with pytest.raises(FileFormatError) as told, told_of(tmp_path / "x.parquet"):
        raise OSError("Couldn't deserialize thrift: TProtocolException: Invalid data\n")
    assert str(told.value).endswith("Invalid data")
    with pytest.raises(FileFormatError, match=r"can't be read: no magic bytes$"), told_of(tmp_path / "x.parquet"):
        raise ValueError("no magic bytes\n")
