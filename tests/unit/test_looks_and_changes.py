"""Who lists what stands in a folder while another process changes it: at every step of the look, nothing is lost."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from silo.core.runtime import announce_segment, list_held, list_segments
from silo.journal.folders import remember_folder, remembered_folders
from silo.segment.held_runs import hold, remove

STEPS = ("exists", "is_symlink", "readlink", "unlink", "symlink_to", "lstat", "glob")


@pytest.fixture(params=range(14))
def beside(request, monkeypatch) -> Callable[[Callable[[], object], Callable[[], object]], bool]:
    """`beside(look, change)`: look, and let another process come in before that step; False where there is none."""

    def run(look: Callable[[], object], change: Callable[[], object]) -> bool:
        steps = iter(range(1000))

        def stepped(method: Callable[..., object]) -> Callable[..., object]:
            def step(*given: object, **named: object) -> object:
                if next(steps) == request.param:
                    change()
                return method(*given, **named)

            return step

        with monkeypatch.context() as patch:
            for name in STEPS:
                patch.setattr(Path, name, stepped(getattr(Path, name)))
            look()
        return next(steps) > request.param

    return run


@pytest.fixture
def segment(tmp_path) -> Path:
    return tmp_path / ".arm.1.0.segment"


def test_a_segment_that_is_removed_while_somebody_looks_is_there_or_not(beside, segment):
    segment.touch()
    announce_segment(segment)
    beside(list_segments, lambda: remove(segment))
    remove(segment)
    assert list_segments() == []


def test_a_held_run_that_is_removed_while_somebody_looks_is_there_or_not(beside, segment):
    segment.touch()
    held = hold(segment)
    beside(list_held, lambda: remove(held))
    remove(held)
    assert list_held() == []


def test_a_run_that_gets_its_held_name_while_somebody_looks_keeps_what_tells_of_it(beside, segment):
    segment.touch()
    held = segment.with_suffix(".held")
    announce_segment(held)
    if not beside(list_held, lambda: segment.rename(held)):
        segment.rename(held)
    assert list_held() == [held]


def test_a_segment_that_is_made_while_somebody_looks_keeps_what_tells_of_it(beside, segment):
    announce_segment(segment)

    def make() -> None:
        segment.touch()
        announce_segment(segment)

    if not beside(list_segments, make):
        make()
    assert list_segments() == [segment]


def test_a_segment_that_is_announced_again_is_found_all_the_while(beside, segment):
    segment.touch()
    announce_segment(segment)
    found: list[list[Path]] = []
    beside(lambda: announce_segment(segment), lambda: found.append(list_segments()))
    assert found in ([], [[segment]])


def test_a_folder_that_gets_a_journal_while_somebody_looks_is_remembered(beside, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    journal = tmp_path / ".arm.1-2.0.journal"
    journal.mkdir()
    remember_folder(tmp_path)
    shutil.rmtree(journal)

    def begin() -> None:
        journal.mkdir()
        remember_folder(tmp_path)

    if not beside(remembered_folders, begin):
        begin()
    assert remembered_folders() == [tmp_path]
