"""The parts that recorders list, as they are found below a logger's folder."""

import os
from pathlib import Path

import msgspec
import pytest

from silo.files.manifest import PartEntry, RecordedTotals, Written, written_path
from silo.recordings.folder import part_named, parts_below

MANY = 50


@pytest.fixture
def place(tmp_path: Path):
    """A folder with two recorders' folders of many parts each, open."""
    for name in ("walk", "stand"):
        folder = tmp_path / name
        folder.mkdir()
        entries = []
        for number in range(1, MANY + 1):
            part = folder / f"{name}_20260101_00-00-00_{number:05d}.mcap"
            part.write_bytes(b"part")
            entries.append(PartEntry(part.name, part.stat().st_ino, 4))
        written_path(folder, name).write_bytes(msgspec.json.encode(Written(name, parts=entries)))
    descriptor = os.open(tmp_path, os.O_RDONLY)
    yield descriptor
    os.close(descriptor)


def test_all_parts_of_all_recorders_are_listed(place) -> None:
    found = [(part.folder, part.recorder) for part in parts_below(place)]
    assert found.count(("walk", "walk")) == found.count(("stand", "stand")) == MANY
    assert len(found) == 2 * MANY


def test_whoever_asks_for_a_part_has_no_other_looked_at(place, monkeypatch) -> None:
    looked = []
    real = os.stat

    def stat(path, **more):
        looked.append(path)
        return real(path, **more)

    monkeypatch.setattr(os, "stat", stat)
    wanted = f"walk_20260101_00-00-00_{MANY:05d}.mcap"
    found = part_named(place, wanted)
    assert (found.folder, found.recorder, found.about.st_size) == ("walk", "walk", 4)
    assert [path for path in looked if str(path).endswith(".mcap")] == [wanted]


@pytest.mark.parametrize(
    "name", ["walk.mcap", "walk_20260101_00-00-00_00099.mcap", "other_20260101_00-00-00_00001.mcap"]
)
def test_a_name_that_no_list_has_is_no_part(place, name) -> None:
    assert part_named(place, name) is None


def test_a_file_that_somebody_put_in_the_place_of_a_part_is_none(place, tmp_path) -> None:
    part = tmp_path / "walk" / "walk_20260101_00-00-00_00001.mcap"
    part.with_suffix(".new").write_bytes(b"other")
    part.with_suffix(".new").replace(part)
    assert part_named(place, part.name) is None
    assert len(list(parts_below(place))) == 2 * MANY - 1


def test_what_became_of_a_recording_counts_one_file_as_one():
    assert RecordedTotals(1, 1, 0).text == "1 file, 1 sample, 0 lost"
    assert RecordedTotals(1, 5, 0, 2_500_000).text == "1 file, 5 samples, 0 lost, 2.5 MB"
    assert RecordedTotals(2, 0, 3, gone=1).text == "2 files, 0 samples, 3 lost, and the end of a run"
