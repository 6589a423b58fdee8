"""Fetching a recording: in pieces, checked, resumed after whatever, in place only when whole."""

import errno
import fcntl
import os
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from silo.errors import ConnectionLostError, SaveError
from silo.recordings import fetching
from silo.recordings.fetching import FIRST_PIECE, Fetch
from silo.recordings.folder import RecordingFolder
from silo.recordings.requests import GetPiece, PartOfRecording, Piece, RecordingParts
from silo.rpc.refusals import RequestRefusedError
from tests.ipc.test_recordings import recording, saved


class Robot:
    """The helper's side on a folder; `cut_after` pieces the link is cut, for good or until it is asked again."""

    def __init__(self, folder: Path) -> None:
        self.place, self.folder = str(folder), RecordingFolder()
        self.cut_after, self.connected, self.mends = -1, True, False
        self.pieces: list[GetPiece] = []
        self.damage: Callable[[Piece], Piece] = lambda piece: piece

    def parts(self, name: str) -> RecordingParts:
        return self.folder.parts(self.place, name)

    def piece(self, path: str, mark: str, offset: int, count: int, sum_only: bool) -> Piece:
        if not sum_only:
            if self.cut_after == 0:
                self.connected = False
                self.cut_after = -1 if self.mends else 0
                raise ConnectionLostError("the link is cut")
            self.cut_after -= 1
            self.pieces.append(GetPiece(path=path, mark=mark, offset=offset, count=count))
        request = GetPiece(path=path, mark=mark, offset=offset, count=count, sum_only=sum_only)
        return self.damage(self.folder.piece(self.place, request))

    def is_connected(self) -> bool:
        self.connected = self.connected or self.mends
        return self.connected

    def fetch(self, name: str, folder: Path, patience_s: float = 0.0, **how) -> Path:
        return Fetch(self.parts, self.piece, self.is_connected, patience_s).run(name, folder, **how)


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return Robot(tmp_path / "robot")


@pytest.fixture
def here(tmp_path: Path) -> Path:
    return tmp_path / "here"


def large(folder: Path) -> str:
    """Save one of several pieces; return its name."""
    from silo.files import write

    path = write(recording(entries=3000), folder, "bot", ["silo"], why="saved by ann")[0].path
    return Path(path).name


def same(robot: Robot, name: str, here: Path) -> bool:
    one, other = Path(robot.place) / name, here / name
    if one.is_dir():
        return {p.name: p.read_bytes() for p in one.iterdir()} == {p.name: p.read_bytes() for p in other.iterdir()}
    return one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_a_recording_comes_whole_with_its_time_of_change(robot, here, kind):
    stem = saved(Path(robot.place), kind)
    name = {"silo": f"{stem}.silo", "csv": f"{stem}.csv", "bag": f"{stem}.rosbag2"}[kind]
    path = robot.fetch(name, here)
    assert path == here / name
    assert same(robot, name, here)
    assert kind != "csv" or same(robot, f"{name}.json", here)
    if kind != "bag":
        assert path.stat().st_mtime_ns == (Path(robot.place) / name).stat().st_mtime_ns
    assert not list(here.glob("*.part"))


def test_after_a_cut_it_goes_on_from_where_it_was(robot, here):
    name = large(Path(robot.place))
    robot.cut_after = 2
    with pytest.raises(ConnectionLostError, match=r"kept in .*\.part.*fetch again"):
        robot.fetch(name, here)
    assert not (here / name).exists()
    came = sum(piece.count for piece in robot.pieces)
    robot.pieces.clear()
    robot.cut_after, robot.connected = -1, True
    told: list[int] = []
    robot.fetch(name, here, progress=lambda done, total: told.append(done))
    assert robot.pieces[0].offset == came == told[0] > 0
    assert robot.pieces[-1].offset + robot.pieces[-1].count == told[-1] == (here / name).stat().st_size
    assert same(robot, name, here)


def test_a_link_that_comes_back_in_time_is_waited_for_and_asked_for_a_quarter_as_much(robot, here, monkeypatch):
    monkeypatch.setattr(fetching, "FAST_S", -1.0)
    monkeypatch.setattr(fetching, "SLOW_S", 1e9)
    name = large(Path(robot.place))
    robot.cut_after, robot.mends = 2, True
    robot.fetch(name, here, patience_s=60.0)
    assert same(robot, name, here)
    offsets = [piece.offset for piece in robot.pieces]
    assert offsets == sorted(set(offsets))
    assert [piece.count for piece in robot.pieces[:3]] == [FIRST_PIECE, FIRST_PIECE, FIRST_PIECE // 4]


def test_what_came_of_another_content_is_not_gone_on_with(robot, here):
    name = large(Path(robot.place))
    here.mkdir()
    (here / f"{name}.part").write_bytes(b"something else" * 1000)
    robot.fetch(name, here)
    assert robot.pieces[0].offset == 0
    assert same(robot, name, here)


def test_a_part_that_is_longer_than_the_file_is_cut(robot, here):
    name = large(Path(robot.place))
    here.mkdir()
    (here / f"{name}.part").write_bytes((Path(robot.place) / name).read_bytes() + b"more")
    robot.fetch(name, here)
    assert robot.pieces == []
    assert same(robot, name, here)


def test_a_bag_of_which_half_came_is_gone_on_with_and_holds_nothing_else(robot, here):
    name = f"{saved(Path(robot.place), 'bag')}.rosbag2"
    robot.cut_after = 1
    with pytest.raises(ConnectionLostError):
        robot.fetch(name, here)
    assert not (here / name).exists()
    (here / f"{name}.part" / "old_0.mcap").write_bytes(b"of a bag before")
    robot.cut_after, robot.connected = -1, True
    robot.fetch(name, here)
    assert same(robot, name, here)


def test_a_piece_that_came_damaged_is_not_kept(robot, here):
    name = large(Path(robot.place))
    robot.damage = lambda piece: Piece(piece.count, piece.crc32, piece.data[:-1] + b"?")
    with pytest.raises(ConnectionLostError, match="damaged"):
        robot.fetch(name, here)
    assert not (here / name).exists()


def test_a_file_that_is_written_anew_meanwhile_is_told(robot, here):
    name = large(Path(robot.place))

    def write_anew(done: int, total: int) -> None:
        os.utime(Path(robot.place) / name, ns=(1, 1))

    with pytest.raises(RequestRefusedError, match="written anew"):
        robot.fetch(name, here, progress=write_anew)
    assert not (here / name).exists()


def test_a_file_that_is_there_is_kept_unless_it_may_be_replaced(robot, here):
    name = large(Path(robot.place))
    here.mkdir()
    (here / name).write_text("mine")
    with pytest.raises(SaveError, match="exists already"):
        robot.fetch(name, here)
    assert (here / name).read_text() == "mine"
    robot.fetch(name, here, replace=True)
    assert same(robot, name, here)


def test_a_full_disk_is_told_with_what_is_needed_before_anything_comes(robot, here, monkeypatch):
    name = large(Path(robot.place))
    monkeypatch.setattr(fetching, "disk_room", lambda path: (1000, 10**9))
    with pytest.raises(SaveError, match=r"[\d.]+ k?B more are needed, [\d.]+ k?B are free.*make room"):
        robot.fetch(name, here)
    assert robot.pieces == []
    assert not (here / name).exists()


def test_a_disk_that_fills_up_is_told_and_what_came_is_gone_on_with(robot, here, monkeypatch):
    name = large(Path(robot.place))
    write = fetching.write_all

    def full(file, data, offset):
        if offset:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(file, data, offset)

    monkeypatch.setattr(fetching, "write_all", full)
    with pytest.raises(SaveError, match=r"No space left.*are kept in"):
        robot.fetch(name, here)
    first = robot.pieces[0].count
    robot.pieces.clear()
    monkeypatch.setattr(fetching, "write_all", write)
    robot.fetch(name, here)
    assert robot.pieces[0].offset == first
    assert same(robot, name, here)


def test_two_do_not_fetch_the_same_at_once(robot, here):
    name = large(Path(robot.place))
    here.mkdir()
    with (here / f"{name}.part").open("wb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(SaveError, match="being fetched already"):
            robot.fetch(name, here)


@pytest.mark.parametrize("step", ["open", "flock"])
@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_who_comes_as_another_one_has_just_fetched_it_is_told(robot, here, monkeypatch, step, kind):
    stem = saved(Path(robot.place), kind)
    name = {"silo": f"{stem}.silo", "csv": f"{stem}.csv", "bag": f"{stem}.rosbag2"}[kind]
    where = {"open": os, "flock": fcntl}[step]
    plain = getattr(where, step)

    def fetched_before(*given: object, **named: object) -> object:
        if step == "open" and not str(given[0]).startswith(str(here)):
            return plain(*given, **named)
        monkeypatch.setattr(where, step, plain)
        robot.fetch(name, here)
        return plain(*given, **named)

    monkeypatch.setattr(where, step, fetched_before)
    with pytest.raises(SaveError, match=r"exists already.*nothing was fetched"):
        robot.fetch(name, here)
    assert same(robot, name, here)
    assert not list(here.glob("*.part"))


def test_whoever_watches_may_give_up_and_go_on_later(robot, here):
    name = large(Path(robot.place))

    def give_up(done: int, total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        robot.fetch(name, here, progress=give_up)
    robot.pieces.clear()
    robot.fetch(name, here)
    assert robot.pieces[0].offset > 0
    assert same(robot, name, here)


@pytest.mark.parametrize("path", ["../x.silo", "/tmp/x", "x.silo/../../y", "other.silo", "x.silo/in", "", "x.silo\0"])
def test_a_robot_can_not_have_anything_written_elsewhere(tmp_path, path):
    told = RecordingParts("x.silo", False, [PartOfRecording(path, 4, "m", 0)])
    fetch = Fetch(lambda name: told, lambda *_: Piece(4, 0, b"evil"), lambda: True, 0.0)
    here = tmp_path / "here"
    with pytest.raises(ConnectionLostError, match="nothing was fetched"):
        fetch.run("x.silo", here)
    assert list(tmp_path.rglob("*")) == []


@pytest.mark.parametrize(("name", "is_folder"), [("../precious", True), ("../precious", False), ("y.silo", True)])
def test_a_robot_can_not_have_a_folder_replaced_by_calling_the_recording_otherwise(tmp_path, name, is_folder):
    kept = tmp_path / "precious" / "thesis.txt"
    kept.parent.mkdir()
    kept.write_text("years")
    told = RecordingParts(name, is_folder, [PartOfRecording("x.silo/a.mcap" if is_folder else "x.silo", 4, "m", 0)])
    fetch = Fetch(lambda _: told, lambda *_: Piece(4, zlib.crc32(b"evil"), b"evil"), lambda: True, 0.0)
    with pytest.raises(ConnectionLostError, match=r"told of no part of 'x\.silo'; nothing was fetched"):
        fetch.run("x.silo", tmp_path / "here")
    assert kept.read_text() == "years"
    assert not (tmp_path / "here").exists()


def test_a_robot_can_not_send_more_than_it_told(tmp_path):
    told = RecordingParts("x.silo", False, [PartOfRecording("x.silo", 4, "m", 0)])
    fetch = Fetch(lambda _: told, lambda *_: Piece(9, zlib.crc32(b"evil more"), b"evil more"), lambda: True, 0.0)
    with pytest.raises(ConnectionLostError, match="came damaged"):
        fetch.run("x.silo", tmp_path)
    assert (tmp_path / "x.silo.part").stat().st_size == 0


def test_pieces_grow_on_a_quick_link(robot, here, monkeypatch):
    monkeypatch.setattr(fetching, "FAST_S", 1e9)
    name = large(Path(robot.place))
    robot.fetch(name, here)
    counts = [piece.count for piece in robot.pieces]
    assert counts[:2] == [FIRST_PIECE, 2 * FIRST_PIECE]
    assert np.all(np.array(counts) <= fetching.MAX_PIECE)


def test_pieces_shrink_on_a_slow_link(robot, here, monkeypatch):
    monkeypatch.setattr(fetching, "FAST_S", -1.0)
    monkeypatch.setattr(fetching, "SLOW_S", -1.0)
    name = large(Path(robot.place))
    robot.fetch(name, here)
    assert min(piece.count for piece in robot.pieces[:-1]) == fetching.MIN_PIECE
