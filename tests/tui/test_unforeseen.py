"""A mistake in silo-tui itself is told and written down, and not told over and over."""

import time

import pytest

from silo_tui.unforeseen import AGAIN_S, Unforeseen, log_file

REST = "what was asked for may not be done. All else goes on; Esc leaves what is open. It stands in {}"


def mistake(*text: str) -> ValueError:
    with pytest.raises(ValueError, match="") as told:
        raise ValueError(*text)
    return told.value


def test_one_place_is_told_of_from_time_to_time_with_how_often_it_came_since(monkeypatch):
    now_s, rest = [100.0], REST.format(log_file())
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    unforeseen, error = Unforeseen(), mistake("no\n such row")
    begun = "a mistake in silo-tui itself, ValueError: no such row"
    assert unforeseen.words(error) == f"{begun}: {rest}"
    now_s[0] += AGAIN_S - 0.1
    assert [unforeseen.words(error), unforeseen.words(error)] == ["", ""]
    now_s[0] += 0.1
    assert unforeseen.words(error) == f"{begun} (2 more since): {rest}"
    now_s[0] += AGAIN_S
    assert unforeseen.words(error) == f"{begun}: {rest}"
    assert unforeseen.words(SystemError()) == f"a mistake in silo-tui itself, SystemError: {rest}"
    assert log_file().read_text().count("ValueError: no\n such row\n") == 3


def test_what_can_not_be_written_down_is_told_so_and_a_large_file_makes_room(monkeypatch):
    monkeypatch.setattr("silo_tui.unforeseen.MOST_BYTES", 10)
    for _ in range(2):
        Unforeseen().words(mistake("first"))
    assert log_file().with_suffix(".log.old").read_text().count("first") >= 1
    log_file().unlink()
    log_file().symlink_to("elsewhere")
    assert "Esc leaves what is open. It can't be written down: [Errno" in Unforeseen().words(mistake())
    assert not log_file().with_name("elsewhere").exists()
