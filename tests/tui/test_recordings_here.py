"""Recordings on this machine: which lie here already, where they are fetched to, what is removed to make room."""

import os
from types import SimpleNamespace

import msgspec
import pytest

from silo.core.elements import FileType
from silo_tui.sessions import recordings
from silo_tui.sessions.recordings import Fetching, GivenUpError, as_listed, bring_here, cache_folder, here, lies_here


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return cache_folder("robot3", "arm")


def put(path, size, at_s=100):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bytes(size))
    os.utime(path, (at_s, at_s))
    return path


def test_a_recording_is_here_where_one_of_its_size_and_time_lies(tmp_path):
    file = as_listed(put(tmp_path / "runs" / "a.silo", 5), FileType.SILO, "runs")
    assert (file.name, file.size_bytes, file.changed_ns, file.folder) == ("a.silo", 5, 100 * 10**9, "runs")
    assert here(tmp_path, file) == tmp_path / "runs" / "a.silo"
    assert here(tmp_path / "runs", file) is None
    for other in (msgspec.structs.replace(file, size_bytes=6), msgspec.structs.replace(file, changed_ns=99 * 10**9)):
        assert here(tmp_path, other) is None


def test_a_bag_is_as_large_as_all_of_its_files_and_as_new_as_the_newest(tmp_path):
    (tmp_path / "bag").mkdir()
    assert as_listed(tmp_path / "bag", FileType.BAG) is None  # a folder without anything
    put(tmp_path / "bag" / "a.mcap", 5, 100)
    put(tmp_path / "bag" / "metadata.yaml", 3, 90)
    found = as_listed(tmp_path / "bag", FileType.BAG)
    assert (found.name, found.size_bytes, found.changed_ns) == ("bag", 8, 100 * 10**9)


def test_a_cache_is_one_of_a_logger_wherever_it_runs(tmp_path, cache, monkeypatch):
    assert cache == tmp_path / "cache" / "silo" / "recordings" / "robot3-arm"
    assert cache_folder("", "arm/../x").name == "here-arm_.._x"
    assert cache_folder("..", "arm").name == "-arm"
    monkeypatch.setenv("HOME", str(tmp_path))
    for wrong in ("", "relative/folder"):
        monkeypatch.setenv("XDG_CACHE_HOME", wrong)
        assert cache_folder("robot3", "arm") == tmp_path / ".cache" / "silo" / "recordings" / "robot3-arm"


def test_what_was_fetched_before_is_not_fetched_again(tmp_path, cache, monkeypatch):
    monkeypatch.setattr(recordings, "CACHED_BYTES", 9)
    before, asked = put(cache / "before.silo", 5), []

    def fetch(name, folder, progress, *, replace):
        asked.append((name, folder, replace))
        return put(folder / name, 5)

    client, fetching = SimpleNamespace(fetch=fetch), Fetching("a.silo")
    file = as_listed(put(tmp_path / "a.silo", 5), FileType.SILO, "runs")
    assert lies_here("/robot/logs", file, cache) is None
    assert bring_here(client, file, cache, fetching) == lies_here("/robot/logs", file, cache) == cache / "a.silo"
    assert asked == [("a.silo", cache, True)]
    assert not before.exists()  # there is no room for both
    lies = put(tmp_path / "logs" / "runs" / "a.silo", 5)
    assert lies_here(str(tmp_path / "logs"), file, cache) == lies


def test_what_was_fetched_longest_ago_makes_room(cache, monkeypatch):
    monkeypatch.setattr(recordings, "CACHED_BYTES", 100)
    paths = [put(cache / f"{each}.silo", 30) for each in "abc"]
    put(cache / "bag" / "a.mcap", 25)
    put(cache.parent / "other" / "d.silo", 15)
    newest = put(cache / "new.silo", 20)
    put(cache / "new.silo.json", 90)
    ages = {"new.silo.json": 9, "d.silo": 8, "c.silo": 7, "b.silo": 6, "bag": 5, "a.silo": 4}

    class Dated(type(cache)):
        def lstat(self):
            found = super().lstat()
            return SimpleNamespace(st_size=found.st_size, st_mode=found.st_mode, st_ctime=ages.get(self.name, 0))

    recordings._make_room(Dated(cache.parent), newest)
    assert {path.name for path in cache.iterdir()} == {"new.silo", "new.silo.json", "b.silo", "c.silo"}
    assert (cache.parent / "other" / "d.silo").exists()
    assert not paths[0].exists()


def test_how_far_a_fetch_is_counts_what_came_since_it_began(monkeypatch):
    monkeypatch.setattr(recordings, "time", SimpleNamespace(monotonic=lambda: 104.0))
    fetching = Fetching("a.silo", began_s=100.0)
    assert fetching.words == "fetching a.silo"
    fetching.progress(2_000_000, 8_000_000)  # which lay here
    assert fetching.words == "fetching a.silo  25%  0 B/s"
    fetching.progress(6_000_000, 8_000_000)
    assert fetching.words == "fetching a.silo  75%  1 MB/s"
    fetching.given_up = True
    with pytest.raises(GivenUpError):
        fetching.progress(7_000_000, 8_000_000)
    assert fetching.done == 6_000_000
