"""Moments that are typed: by how long ago, after how long, by the clock; and the cursor that goes there."""

import time

import pytest

from silo_tui.model.plots.time_axis import moment_of, seconds_words

S = 10**9
NEWEST = 1_700_000_039 * S + S // 2  # 22:13:59.5 UTC


@pytest.fixture
def zone(monkeypatch):
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.parametrize(
    ("words", "before_s"),
    [("-3s", 3), ("-250ms", 0.25), ("+2s", 7), ("+ 500 ms", 8.5),
     ("+9", 0), (" -2 min ", 120), ("-1.5", 1.5), ("0", 0), ("22:13", 59.5), ("22:13:59", 0.5),
     ("22:13:59.25", 0.25), ("22:14", 86400 - 0.5), ("2:00:00.125", 20 * 3600 + 13 * 60 + 59.375)],
)  # fmt: skip
def test_a_moment_before_the_newest_one_is_typed_as_it_is_shown(zone, words, before_s):
    assert moment_of(words, NEWEST, NEWEST, NEWEST - 9 * S) == NEWEST - round(before_s * S)


@pytest.mark.parametrize(
    ("words", "after_s"), [("12.5", 12.5), ("3s", 3), (".25", 0.25), ("0", 0), ("-3s", 27), ("+2s", 12)]
)
def test_a_moment_of_a_file_counts_from_its_beginning_and_before_its_end(words, after_s):
    assert moment_of(words, 100 * S, 130 * S, 110 * S) == 100 * S + round(after_s * S)


@pytest.mark.parametrize(
    ("words", "says"),
    [("soon", "'soon' is no time: -3s"), ("", "type a time: -3s"), ("3 apples", "is no time"), ("25:00", "is no time"),
     ("12:60", "is no time"), ("--3s", "is no time"), ("+-3s", "is no time"),
     ("+21s", "later than"), ("+", "is no time"), ("31s", "later than all that is held, which ends at 30 s"),
     ("nan", "is no time"), ("1e400", "is no time"), ("13:07", "a clock of its own")],
)  # fmt: skip
def test_what_is_no_moment_is_said(words, says):
    with pytest.raises(ValueError, match=says):
        moment_of(words, 100 * S, 130 * S, 110 * S)


@pytest.mark.slow
async def test_the_cursor_goes_to_a_moment_that_is_typed(screen, ran_s=12):
    await screen.press("m")
    await screen.shows("live")
    await screen.press("slash")
    await screen.shows("Find in")
    await screen.press(*"5s", "enter")
    await screen.shows("5s is later than all that is held")
    await screen.press("backspace", "backspace", *"-3s", "enter")
    await screen.shows("A -3.000 s")
    plots = screen.app.screen
    assert plots.window.paused
    assert plots.held_ns[1] - plots.window.at_ns == 3 * S


@pytest.mark.parametrize(
    ("first_s", "last_s", "words"),
    [
        (-0.1, 47.3, ["0 s", "10 s", "20 s", "30 s", "40 s"]),
        (121.7, 131.7, ["122 s", "124 s", "126 s", "128 s", "130 s"]),
        (0.0, 19.9975, ["0 s", "5 s", "10 s", "15 s", "20 s"]),
        (0.0, 0.05, ["0.00 s", "0.01 s", "0.02 s", "0.03 s", "0.04 s", "0.05 s"]),
        (-23.4, -13.4, ["-22 s", "-20 s", "-18 s", "-16 s", "-14 s"]),
    ],
)  # fmt: skip
def test_seconds_below_what_stands_still_are_round_and_at_their_places(first_s, last_s, words):
    found = seconds_words(first_s, last_s)
    assert [word for _, word in found] == words
    for share, word in found:
        assert first_s + share * (last_s - first_s) == pytest.approx(
            float(word.split()[0]), abs=5e-3 * (last_s - first_s)
        )
