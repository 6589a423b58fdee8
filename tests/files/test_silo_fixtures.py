"""Files that the original wrote read back with every value and every time stamp right."""

import json
import shutil

import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.files.silo.reader import read_silo
from silo.files.silo.writer import write_silo
from tests.pages import DOCS, carry_out

NAMES = ["all_types", "looping_wrapped", "mixed_dividers", "time_buffer_full"]
TYPES = {"double": "<f8", "single": "<f4", "string": "S"}


def entries_of(recording):
    return {entry.name: (element, entry) for element in recording.elements for entry in element.entries}


@pytest.fixture(params=NAMES)
def truth(request, fixtures_folder):
    return json.loads((fixtures_folder / f"{request.param}.json").read_text())


@pytest.fixture
def recording(truth, fixtures_folder):
    return read_silo(fixtures_folder / f"{truth['fixture']}.silo")


def saved(truth):
    return [(element, entry) for element in truth["elements"] if element["in_file"] for entry in element["entries"]]


def test_exactly_the_saved_entries_are_there(truth, recording):
    assert list(entries_of(recording)) == [entry["name"] for _, entry in saved(truth)]
    assert recording.warnings == ()


def test_every_value_is_right(truth, recording):
    entries = entries_of(recording)
    for element, entry in saved(truth):
        values = entries[entry["name"]][1].values
        kept = [entry["values"][tick] for tick in element["kept_ticks"]]
        if values.dtype.kind == "S":
            # the trailing dashes of a string can't be told from the padding
            assert values.tolist() == [text.encode().rstrip(b"-") for text in kept]
        elif values.dtype.kind == "f":
            # JSON has no NaN, so the truth may name it
            np.testing.assert_array_equal(values, np.array([float(value) for value in kept], values.dtype))
        else:
            assert values.dtype == np.dtype(entry["data_type"])
            assert values.tolist() == [int(value) for value in kept]


def test_every_time_stamp_is_right(truth, recording):
    entries = entries_of(recording)
    stamps = [seconds * 10**9 + nanoseconds for seconds, nanoseconds in truth["timestamps_s_ns"]]
    for element, entry in saved(truth):
        recorded = entries[entry["name"]][0]
        assert recording.time_ns[recorded.stamp_indices].tolist() == [stamps[tick] for tick in element["kept_ticks"]]


def test_what_the_header_says_of_the_log_is_right(truth, recording):
    first, last = truth["time_kept_ticks"]
    assert recording.offset == truth["time_synchronization_offset"]
    assert len(recording.time_ns) == last - first + 1
    assert recording.prefix == truth["prefix"]
    assert recording.time_looping == (truth["time_buffer"]["type"] == "LOOPING")


def test_looping_elements_are_known_as_such(truth, recording):
    entries = entries_of(recording)
    for element, entry in saved(truth):
        looping = entries[entry["name"]][0].buffer_type is BufferType.LOOPING
        assert looping == (element["buffer_type"] == "LOOPING")


def test_written_again_the_table_and_the_data_are_the_same(truth, recording, fixtures_folder, tmp_path):
    write_silo(recording, tmp_path / "again.silo")
    theirs = (fixtures_folder / f"{truth['fixture']}.silo").read_bytes()
    ours = (tmp_path / "again.silo").read_bytes()
    their_head, their_data = theirs.split(b"# Binary Data\n", 1)
    our_head, our_data = ours.split(b"# Binary Data\n", 1)
    assert our_data == their_data
    table = [line for line in their_head.split(b"\n") if not line.startswith(b"#")]
    assert [line for line in our_head.split(b"\n") if not line.startswith(b"#")] == table


def test_vectors_matrices_and_quaternions_are_put_together(fixtures_folder):
    recording = read_silo(fixtures_folder / "all_types.silo")
    kinds = {element.name: (element.kind, element.shape) for element in recording.elements}
    assert kinds["/log/types/t_vec3"] == ("vector", (3,))
    assert kinds["/log/types/t_vec6"] == ("vector", (6,))
    assert kinds["/log/types/t_mat23"] == ("matrix", (2, 3))
    assert kinds["/log/types/t_quat"] == ("quaternion", (4,))
    assert kinds["/log/types/t_angleaxis"] == ("angle_axis", (4,))
    assert kinds["/log/types/t_pair_key"] == ("scalar", ())


def test_the_older_spelling_of_the_data_line_is_understood(fixtures_folder):
    recording = read_silo(fixtures_folder / "testData")
    assert recording.warnings == ()
    assert recording.time_ns.tolist() == [second * 10**9 for second in range(1, 9)]
    assert entries_of(recording)["/log/A"][1].values.tolist() == [2.0**power for power in range(1, 9)]
    assert [element.first for element in recording.elements] == [0, 0, 0]


def test_the_page_for_who_comes_from_the_original_opens_old_files_as_it_says(
    fixtures_folder, tmp_path, monkeypatch, capsys
):
    for name in ("mixed_dividers.silo", "mixed_dividers.yaml"):
        shutil.copy(fixtures_folder / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    carry_out("coming-from-signal_logger.md", "Open your old files")
    said = (
        (DOCS / "coming-from-signal_logger.md").read_text().split("slow.times[:3])")[1].split("# ")[1].splitlines()[0]
    )
    assert capsys.readouterr().out.splitlines()[-1] == said
