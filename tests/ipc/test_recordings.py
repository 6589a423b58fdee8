"""The recordings of a logger's folder: what is listed, what may be read, and what may be deleted, whatever is asked."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from silo.core.elements import BufferType, Entry, FileType, LoggedEvent
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files import write
from silo.files.atomic import sweep_parts
from silo.files.bags.writer import write_bag
from silo.files.convert import convert
from silo.recordings import folder as module
from silo.recordings.folder import RecordingFolder
from silo.recordings.requests import GetPiece
from silo.rpc.refusals import RefusedWhy, RequestRefusedError

SECOND = 10**9
BEGIN = 1_700_000_000 * SECOND


def recording(logger: str = "bot", entries: int = 1) -> Recording:
    """Five seconds of so many signals."""
    time_ns = BEGIN + np.arange(6, dtype=np.int64) * SECOND
    elements = [
        RecordedElement(
            f"/log/x{n}", "m", "scalar", (), 1, BufferType.LOOPING, 0,
            (RecordedEntry(f"/log/x{n}", Entry("", "<f8"), np.arange(6.0)),),
        )
        for n in range(entries)
    ]  # fmt: skip
    return Recording(logger, time_ns, 6, elements)


def saved(folder: Path, *types: str, logger: str = "bot", name: str | None = None, why: str = "saved by ann") -> str:
    """Save one, and return its stem."""
    files = write(recording(logger), folder, logger, types or ("silo",), name, why=why)
    return Path(files[0].path).name.partition(".")[0]


def listed(folder: Path, most: int = 100):
    return RecordingFolder().listing(str(folder), "bot", most)


def refusal(call, *arguments) -> RefusedWhy:
    with pytest.raises(RequestRefusedError) as error:
        call(*arguments)
    return error.value.why


# -------------------------------------------------------------------------------------------------------- listing


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_markers_that_somebody_set_are_counted(tmp_path, kind):
    events = [LoggedEvent("marker", f"push {n}", tick=n) for n in range(3)] + [LoggedEvent("started", "it runs")]
    write(replace(recording(), events=events), tmp_path, "bot", [kind], None, why="saved by ann")
    assert [row.markers for row in listed(tmp_path).recordings] == [3]


def recorded(folder: Path, name: str = "walk_1") -> Path:
    """Write a part as a recorder does, with its list beside it."""
    folder.mkdir(exist_ok=True)
    part = folder / f"{name}.mcap"
    write_bag(recording(), part)
    entries = [{"name": part.name, "inode": part.stat().st_ino, "size_bytes": part.stat().st_size}]
    (folder / ".walk.recorder.json").write_text(json.dumps({"recorder": "walk", "parts": entries}))
    return part


def test_parts_of_endless_recordings_are_listed_with_their_folder_and_times(tmp_path):
    saved(tmp_path)
    part = recorded(tmp_path / "recordings")
    row = next(row for row in listed(tmp_path).recordings if row.stem == "recordings/walk_1")
    assert (row.why, row.begun_ns, row.span_s, row.own) == ("recording walk", BEGIN, 5.0, False)
    assert [(file.name, file.folder, file.size_bytes) for file in row.files] == [
        (part.name, "recordings", part.stat().st_size)
    ]
    assert listed(tmp_path).count == 2
    assert len(listed(tmp_path, 1).recordings) == 1
    assert listed(tmp_path, 1).recorded == {"recordings/walk": part.stat().st_size}  # however few are asked for


def test_a_part_is_read_in_pieces_by_its_plain_name(tmp_path):
    part = recorded(tmp_path / "recordings")
    folder = RecordingFolder()
    (told,) = folder.parts(str(tmp_path), part.name).parts
    data = folder.piece(str(tmp_path), GetPiece(path=told.path, mark=told.mark, offset=0, count=told.size_bytes)).data
    assert data == part.read_bytes()


def test_of_folders_below_only_files_that_a_recorder_wrote_are_told_of(tmp_path):
    part = recorded(tmp_path / "recordings")
    (part.parent / "mine.mcap").write_bytes(part.read_bytes())
    (tmp_path / "others").mkdir()
    (tmp_path / "others" / "theirs.mcap").write_bytes(part.read_bytes())
    elsewhere = tmp_path / "elsewhere"
    elsewhere.symlink_to(part.parent)
    folder = RecordingFolder()
    assert [row.stem for row in listed(tmp_path).recordings] == ["recordings/walk_1"]
    for name in ("mine.mcap", "theirs.mcap"):
        assert refusal(folder.parts, str(tmp_path), name) is RefusedWhy.INVALID
    (part.parent / ".walk.recorder.json").write_text("{")
    assert listed(tmp_path).recordings == []


def test_a_part_that_was_cut_is_listed_without_times(tmp_path):
    part = recorded(tmp_path / "recordings")
    os.truncate(part, part.stat().st_size - 5)
    (row,) = listed(tmp_path).recordings
    assert (row.begun_ns, row.span_s) == (0, 0.0)


def test_a_part_is_not_deleted_by_a_client(tmp_path):
    part = recorded(tmp_path / "recordings")
    folder = RecordingFolder()
    (row,) = listed(tmp_path).recordings
    for name in (part.name, row.stem, f"recordings/{part.name}", part.stem):
        words = f"a part of recording.*budget.*{tmp_path}/recordings on the robot"
        with pytest.raises(RequestRefusedError, match=words):
            folder.delete(str(tmp_path), "bot", name)
    assert part.exists()


def test_the_files_of_one_save_are_one_recording_that_says_when_how_long_and_why(tmp_path):
    stem = saved(tmp_path, "silo", "csv", "bag", why="trigger fall")
    (row,) = listed(tmp_path).recordings
    assert (row.stem, row.why, row.logger, row.begun_ns, row.span_s) == (stem, "trigger fall", "bot", BEGIN, 5.0)
    assert [file.type for file in row.files] == [FileType.SILO, FileType.CSV, FileType.BAG]
    assert row.own
    bag = tmp_path / f"{stem}.rosbag2"
    assert row.files[2].size_bytes == sum(file.stat().st_size for file in bag.iterdir())


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_every_format_alone_says_why_it_was_saved_and_when(tmp_path, kind):
    saved(tmp_path, kind, why="program died")
    (row,) = listed(tmp_path).recordings
    assert (row.why, row.begun_ns, row.span_s, row.own) == ("program died", BEGIN, 5.0, True)


def test_why_is_kept_when_a_file_is_read(tmp_path):
    from silo.files.formats import read_recording

    saved(tmp_path, "silo", "csv", "bag", why='trigger "fall": a\nb')
    for path in tmp_path.glob("bot_*"):
        if path.suffix != ".json":
            assert read_recording(path).why == 'trigger "fall": a\nb', path
    assert {row.why for row in listed(tmp_path).recordings} == {'trigger "fall": a\nb'}


def test_the_newest_come_first_and_the_others_are_counted(tmp_path):
    stems = [saved(tmp_path, name=f"walk{n}") for n in range(3)]
    for age, stem in enumerate(stems):
        os.utime(tmp_path / f"{stem}.silo", ns=(BEGIN + age, BEGIN + age))
    found = listed(tmp_path, most=2)
    assert [row.stem for row in found.recordings] == ["walk2", "walk1"]
    assert found.count == 3


def test_what_others_keep_in_the_folder_is_not_listed(tmp_path):
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    (tmp_path / "notes.silo").write_text("to do\n")
    (tmp_path / "fake.rosbag2").mkdir()
    (tmp_path / "file.bag").write_text("ROS 1")
    (tmp_path / "logger.yaml").write_text("log_elements: []\n")
    os.mkfifo(tmp_path / "pipe.silo")
    found = listed(tmp_path)
    assert (found.recordings, found.count) == ([], 0)


def test_links_are_not_listed(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    stem = saved(elsewhere)
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / f"{stem}.silo").symlink_to(elsewhere / f"{stem}.silo")
    assert listed(logs).recordings == []


def test_an_unfinished_file_is_told(tmp_path):
    (tmp_path / ".silo-12-aabbccdd.part").write_bytes(b"half")
    (row,) = listed(tmp_path).recordings
    assert (row.unfinished, row.size_bytes, row.own) == (True, 4, False)


def test_files_are_looked_into_once_and_again_when_they_change(tmp_path, monkeypatch):
    stem = saved(tmp_path)
    read: list[str] = []
    monkeypatch.setattr(module, "read_summary", lambda folder, name: read.append(name))
    folder = RecordingFolder()
    folder.listing(str(tmp_path), "bot", 10)
    folder.listing(str(tmp_path), "bot", 10)
    assert read == [f"{stem}.silo"]
    os.utime(tmp_path / f"{stem}.silo", ns=(1, 1))
    folder.listing(str(tmp_path), "bot", 10)
    assert read == [f"{stem}.silo"] * 2


def test_what_there_is_no_time_to_look_into_comes_with_the_next_list(tmp_path, monkeypatch):
    saved(tmp_path)
    folder = RecordingFolder()
    monkeypatch.setattr(module, "READ_S", -1.0)
    (row,) = folder.listing(str(tmp_path), "bot", 10).recordings
    assert (row.unread, row.own, row.why) == (True, False, "")
    monkeypatch.setattr(module, "READ_S", 60.0)
    (row,) = folder.listing(str(tmp_path), "bot", 10).recordings
    assert (row.unread, row.own) == (False, True)


def test_a_folder_that_is_not_there_yet_is_told(tmp_path):
    assert refusal(listed, tmp_path / "none") is RefusedWhy.NOT_FOUND


# --------------------------------------------------------------------------------------------------- hostile names

HOSTILE = [
    "",
    ".",
    "..",
    "../x.silo",
    "/etc/passwd",
    "a/../../x.silo",
    "x\0.silo",
    ".hidden.silo",
    "x\n.silo",
    "y" * 300,
]


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_leads_out_of_the_folder(tmp_path, name):
    logs = tmp_path / "logs"
    saved(logs)
    saved(tmp_path, name="x")
    before = sorted(tmp_path.rglob("*"))
    folder = RecordingFolder()
    bad = {RefusedWhy.FORBIDDEN, RefusedWhy.NOT_FOUND, RefusedWhy.INVALID}
    assert refusal(folder.parts, str(logs), name) in bad
    assert refusal(folder.piece, str(logs), GetPiece(path=name, mark="", offset=0, count=10)) in bad
    assert refusal(folder.delete, str(logs), "bot", name) in bad
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("name", "why", "text"),
    [
        (".x", RefusedWhy.FORBIDDEN, "'.x' is not the name of a recording in {}; nothing was read or changed"),
        ("x.silo", RefusedWhy.NOT_FOUND, "there is no recording 'x.silo' in {}"),
        ("x.rosbag2", RefusedWhy.NOT_FOUND, "there is no recording 'x.rosbag2' in {}"),
    ],
)
def test_what_is_no_recording_is_told(tmp_path, name, why, text):
    for ask in (lambda: RecordingFolder().parts(str(tmp_path), name),
                lambda: RecordingFolder().delete(str(tmp_path), "bot", name)):  # fmt: skip
        with pytest.raises(RequestRefusedError) as told:
            ask()
        assert (told.value.why, str(told.value)) == (why, text.format("the logger's folder"))


@pytest.mark.parametrize("inner", ["../secret.silo", "..", "", "sub/x", "/etc/passwd", "link.mcap"])
def test_no_name_leads_out_of_a_bag(tmp_path, inner):
    stem = saved(tmp_path, "bag")
    (tmp_path / "secret.silo").write_text("secret")
    (tmp_path / f"{stem}.rosbag2" / "link.mcap").symlink_to(tmp_path / "secret.silo")
    request = GetPiece(path=f"{stem}.rosbag2/{inner}", mark="", offset=0, count=10)
    assert refusal(RecordingFolder().piece, str(tmp_path), request) in {
        RefusedWhy.FORBIDDEN, RefusedWhy.NOT_FOUND, RefusedWhy.INVALID, RefusedWhy.FAILED, RefusedWhy.CONFLICT,
    }  # fmt: skip


def test_a_link_is_neither_read_nor_deleted(tmp_path):
    stem = saved(tmp_path / "elsewhere", "silo", "bag")
    logs = tmp_path / "logs"
    logs.mkdir()
    for ending in (".silo", ".rosbag2"):
        (logs / f"{stem}{ending}").symlink_to(tmp_path / "elsewhere" / f"{stem}{ending}")
        assert refusal(RecordingFolder().parts, str(logs), f"{stem}{ending}") is RefusedWhy.FORBIDDEN
        assert refusal(RecordingFolder().delete, str(logs), "bot", f"{stem}{ending}") is RefusedWhy.FORBIDDEN
    assert (tmp_path / "elsewhere" / f"{stem}.silo").exists()


def test_a_file_that_is_no_recording_is_not_read(tmp_path):
    (tmp_path / "table.csv").write_text("password\n1\n")
    (tmp_path / "id_rsa").write_text("secret")
    for name in ("table.csv", "id_rsa", "table.csv.json"):
        why = refusal(RecordingFolder().parts, str(tmp_path), name)
        assert why in {RefusedWhy.FORBIDDEN, RefusedWhy.INVALID}, name
        request = GetPiece(path=name, mark="", offset=0, count=10)
        assert refusal(RecordingFolder().piece, str(tmp_path), request) in {RefusedWhy.FORBIDDEN, RefusedWhy.INVALID}


@pytest.mark.parametrize(("offset", "count"), [(-1, 10), (0, 0), (0, -1), (0, 2**40), (2**63 - 1, 10)])
def test_a_piece_has_its_bounds(tmp_path, offset, count):
    stem = saved(tmp_path)
    folder = RecordingFolder()
    (part,) = folder.parts(str(tmp_path), f"{stem}.silo").parts
    request = GetPiece(path=part.path, mark=part.mark, offset=offset, count=count)
    assert refusal(folder.piece, str(tmp_path), request) is RefusedWhy.INVALID


# -------------------------------------------------------------------------------------------------------- deleting


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_a_recording_is_deleted_with_all_that_belongs_to_it(tmp_path, kind):
    stem = saved(tmp_path, kind)
    other = saved(tmp_path, "silo")
    assert stem in RecordingFolder().delete(str(tmp_path), "bot", stem)
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == [f"{other}.silo"]


def test_a_bag_that_is_deleted_while_somebody_sweeps_the_folder_is_told_as_deleted(tmp_path, monkeypatch):
    stem = saved(tmp_path, "bag")
    rmdir = os.rmdir

    def swept_first(name: str, *, dir_fd: int | None = None) -> None:
        with monkeypatch.context() as now:
            now.setattr(os, "rmdir", rmdir)
            sweep_parts(tmp_path)
        rmdir(name, dir_fd=dir_fd)

    monkeypatch.setattr(os, "rmdir", swept_first)
    assert stem in RecordingFolder().delete(str(tmp_path), "bot", stem)
    assert [path.name for path in tmp_path.iterdir()] == [".bot_fileNumber"]


def test_one_file_of_several_can_be_deleted(tmp_path):
    stem = saved(tmp_path, "silo", "csv")
    RecordingFolder().delete(str(tmp_path), "bot", f"{stem}.csv")
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == [f"{stem}.silo"]


def test_a_name_that_somebody_chose_is_deleted_too_when_the_file_says_who_saved_it(tmp_path):
    saved(tmp_path, name="walk")
    RecordingFolder().delete(str(tmp_path), "bot", "walk.silo")
    assert not (tmp_path / "walk.silo").exists()


def foreign_files(folder: Path) -> dict[str, str]:
    """Files that a logger called bot did not write."""
    other = saved(folder, logger="arm")
    mine = saved(folder, name="mine")
    convert(folder / f"{mine}.silo", folder / "converted.silo")
    (folder / f"{mine}.silo").rename(folder / "arm_20260101_10-00-00_00001.silo")
    write(recording(), folder, "bot", ["silo"], "plain")
    (folder / "bot_20260101_10-00-00_00001.silo").write_text("not a log at all\n")
    (folder / "bot_20260101_10-00-00_00002.csv").write_text("a,b\n")
    return {
        f"{other}.silo": "of another logger",
        "converted.silo": "converted",
        "arm_20260101_10-00-00_00001.silo": "called as one of another logger",
        "plain.silo": "of a name of its own, and nobody saved it",
        "bot_20260101_10-00-00_00001.silo": "no log",
        "bot_20260101_10-00-00_00002.csv": "somebody's table",
        "bot_20260101_10-00-00_00002": "its stem",
    }


def test_what_this_logger_did_not_write_is_not_deleted(tmp_path):
    foreign = foreign_files(tmp_path)
    before = sorted(tmp_path.iterdir())
    for name, what in foreign.items():
        assert refusal(RecordingFolder().delete, str(tmp_path), "bot", name) is RefusedWhy.FORBIDDEN, what
    assert sorted(tmp_path.iterdir()) == before
    own = {row.stem: row.own for row in listed(tmp_path).recordings}
    assert own and not any(own.values())


def test_a_stem_of_which_one_file_is_foreign_is_kept_whole(tmp_path):
    stem = saved(tmp_path, "silo")
    (tmp_path / f"{stem}.csv").write_text("a,b\n")
    assert refusal(RecordingFolder().delete, str(tmp_path), "bot", stem) is RefusedWhy.FORBIDDEN
    assert (tmp_path / f"{stem}.silo").exists()


def test_a_bag_that_holds_other_files_is_not_deleted(tmp_path):
    stem = saved(tmp_path, "bag")
    bag = tmp_path / f"{stem}.rosbag2"
    (bag / "notes.txt").write_text("mine")
    before = sorted(bag.iterdir())
    assert refusal(RecordingFolder().delete, str(tmp_path), "bot", bag.name) is RefusedWhy.FORBIDDEN
    assert sorted(bag.iterdir()) == before


def test_an_unfinished_file_is_not_deleted(tmp_path):
    part = tmp_path / ".silo-12-aabbccdd.part"
    part.write_bytes(b"half")
    assert refusal(RecordingFolder().delete, str(tmp_path), "bot", part.name) is RefusedWhy.FORBIDDEN
    assert part.exists()
