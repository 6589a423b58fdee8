"""What the list of alarms says of the line under the cursor, and of itself, without an app."""

from typing import Any

import numpy as np
import pytest

from silo.conditions.standing import LimitStatus, LimitWord, worst_first
from silo_tui.model.samples.live import Reading
from silo_tui.model.table.cells import sign_of
from silo_tui.screens.lists.alarms import MOST_LINES, AlarmsScreen
from silo_tui.widgets.bars import StatusBar
from tests.stand_ins.desk import Desk, Drawn

HEAT = "/log/imu/temperature"


class Alarms(Drawn, AlarmsScreen):
    """The list, with its cursor on a line."""

    chosen: Any = None

    def __init__(self, session: Any) -> None:
        self.session = session


class Head(Drawn, StatusBar):
    """The head of any screen."""

    width = 120


def limit(name: str = HEAT, word: str = "OK", **more: Any) -> LimitStatus:
    return LimitStatus(name, name, LimitWord(word), **more)


def test_red_stands_before_yellow_before_stale_before_well_and_blind_last():
    words = [one.word.value for one in worst_first([limit(word=word) for word in ("~~", "OK", "==", "L", "HH")])]
    assert words == ["HH", "L", "==", "OK", "~~"]
    assert [word for word in words if LimitWord(word).is_red] == ["HH"]


@pytest.fixture
def alarms(fake):
    return Alarms(Desk(fake.run()).session)


def of(alarms: Alarms, one: LimitStatus, *others: LimitStatus) -> str:
    alarms.session.limits = [one, *others]
    alarms.prepare(alarms.all, 80)
    alarms.chosen = one
    return alarms.words().partition(" │ ")[0]


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (limit(bounds=(None, None, None, 90.0)), "within HH 90"),
        (limit(bounds=(1.0, 2.0, 3.0, 4.0)), "within LL 1 L 2 H 3 HH 4"),
        (limit(bounds=(1.0, None, None, None), stale_s=2.0), "within LL 1, never the same for 2 s"),
        (limit(stale_s=2.0), "never the same for 2 s"),
        (limit(bounds=(None, None, None, 90.0), count=1), "within HH 90 again"),
        (limit(bounds=(None, None, None, 90.0), count=1, alarm=True), "within HH 90 again, seen by nobody yet"),
        (limit(bounds=(None, None, None, 90.0), count=3, alarm=True, seen_by="bob", since_seen=2),
         "within HH 90 again, 2 × again since bob saw it (e e: persist or hyst keep one quiet that flaps)"),
        (limit(word="~~", why="no element x"), f"{HEAT} is blind: no element x"),
    ],
)  # fmt: skip
def test_of_the_line_under_the_cursor_it_is_told_what_it_does_and_who_has_seen_it(one, words, alarms):
    assert of(alarms, one) == words


def test_what_is_beyond_its_limits_is_told_by_what_its_sign_means(alarms):
    one = limit(word="HH", count=1, alarm=True, bounds=(None, None, None, 90.0))
    assert of(alarms, one).endswith(", seen by nobody yet")
    assert "within" not in of(alarms, one)


def test_without_a_line_nothing_is_told(alarms):
    assert alarms.words() == ""
    assert alarms.none() == "No limits. r n gives some"


@pytest.mark.parametrize(("count", "more"), [(MOST_LINES, False), (MOST_LINES + 1, True)])
def test_of_very_many_the_first_have_lines_those_that_are_quiet_come_last(count, more, alarms):
    quiet = [limit(f"/log/{at}") for at in range(count - 1)]
    alarms.session.limits = [*quiet[:5], limit(word="HH", count=1), *quiet[5:]]
    shown = alarms.all
    assert (shown[0].name, len(shown)) == (HEAT, MOST_LINES)
    alarms.prepare(shown, 80)
    alarms.chosen = shown[0]
    assert (f"the first {MOST_LINES} of {count}" in alarms.words()) is more


@pytest.mark.parametrize(
    ("word", "count", "styles"),
    [("HH", 1, "alarm"), ("LL", 1, "alarm"), ("H", 1, "warning"), ("L", 1, "warning"), ("~~", 0, "warning"),
     ("OK", 0, "dim"), ("OK", 1, "")],
)  # fmt: skip
def test_a_line_looks_as_it_stands(word, count, styles, alarms):
    one = limit(word=word, count=count)
    alarms.prepare([one], 80)
    line = alarms.row_of(one, 80)
    assert "temperature" in line.plain
    color = alarms.app.theme_variables.get(styles)
    wanted = [] if not styles else ["dim"] if styles == "dim" else [f"bold {color}"]
    assert [str(span.style) for span in line.spans] == wanted


def test_a_filter_looks_in_what_a_line_says(alarms):
    assert alarms.told(limit(word="HH")).startswith("HH /imu/temperature")
    assert alarms.told(limit(word="~~", why="no such thing")).endswith("no such thing")
    assert alarms.signals_of(limit(HEAT)) == [HEAT]
    assert alarms.signals_of(limit("/log/gone")) == []


@pytest.mark.parametrize(("judged", "value", "words"), [
    ("OK", 41.0, "1 alarm (HH)"), ("HH", 12.0, "1 alarm ended unseen"), ("HH", 41.0, "1 alarm (HH)"),
])  # fmt: skip
def test_the_head_and_the_row_tell_one_moment_of_an_alarm(judged, value, words, alarms):
    session = alarms.session
    one = limit(session.table.names[0], judged, alarm=True, bounds=(None, None, None, 40.0))
    reading = Reading(np.array([value]), {}, 1, 0, 5)
    session.limits, session.table.limits = [one], {one.name: one}
    session.live.time_ns, session.live.readings[one.name] = 5, reading
    assert Head(session).render().plain.endswith(words)
    assert sign_of(session.table, 0, reading) == ("HH" if "HH" in words else "")
    session.live.time_ns = 6  # it isn't on the screen any more
    assert Head(session).render().plain.endswith("1 alarm (HH)" if judged == "HH" else "1 alarm ended unseen")


def test_two_limits_of_a_signal_are_two_lines_for_keys(alarms):
    whole, short, other = (LimitStatus(HEAT, given, LimitWord.OK) for given in (HEAT, "imu/temperature", "imu/*"))
    assert alarms.key_of(whole) == alarms.key_of(short) == HEAT
    assert alarms.key_of(other) == f"{HEAT} of imu/*"
