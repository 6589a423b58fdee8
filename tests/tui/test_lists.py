"""Lists: filter, order and marks as rules, and of each list on the screen; the keys of the list of loggers."""

from typing import NamedTuple

import pytest

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import FileType
from silo.recordings.requests import RecordingFile, Recordings, SavedRecording
from silo_tui.model.lists.ordering import Marks, Order, arranged, passes

SHOWN = ["a", "b", "c", "d"]


@pytest.mark.parametrize(
    ("asked", "found"),
    [("", True), ("fall", True), ("FALL roll", True), ("slip|roll", True), ("-slip", True), ("-roll", False),
     ("slip", False), ("-", False), ("-6", False), ("-7", True)],
)  # fmt: skip
def test_a_line_passes_that_has_all_words(asked, found):
    assert passes("ARMED fall abs(base/roll) > 0.6", asked) == found


def test_an_order_turns_round_with_lines_that_are_alike():
    order = Order("made", "g", "as they were made", lambda one: 0)
    assert arranged("abc", order, turned=False) == ["a", "b", "c"]
    assert arranged("abc", order, turned=True) == ["c", "b", "a"]
    largest = Order("size", "s", "the largest first", len, True)
    assert arranged(["a", "ccc", "bb"], largest, turned=False) == ["ccc", "bb", "a"]


def test_marking_all_again_unmarks_them_and_leaves_what_is_hidden():
    marks = Marks()
    marks.toggle("hidden")
    marks.toggle_all(SHOWN)
    assert marks.keys == {*SHOWN, "hidden"}
    marks.toggle_all(SHOWN)
    assert marks.keys == {"hidden"}
    alone = Marks()
    alone.toggle_all(SHOWN)
    alone.toggle_all(SHOWN)
    assert not alone.keys


def test_esc_says_whether_there_was_a_mark_or_a_range():
    marks = Marks()
    assert not marks.clear()
    marks.toggle("a")
    assert marks.clear()
    marks.range_to("a", SHOWN)
    assert marks.clear()
    assert not marks.clear()


@pytest.mark.parametrize(("begin", "end"), [("b", "d"), ("d", "b")])
def test_a_range_is_marked_whichever_end_it_begins_at(begin, end):
    marks = Marks()
    assert "the same key ends it" in marks.range_to(begin, SHOWN)
    assert marks.range_to(end, SHOWN) == "range of 3 marked"
    assert marks.keys == {"b", "c", "d"}
    assert marks.anchor is None


def test_marks_and_range_of_lines_that_are_gone_are_forgotten():
    marks = Marks()
    marks.toggle("a")
    marks.range_to("b", SHOWN)
    marks.keep(["c"])
    assert (marks.keys, marks.anchor) == (set(), None)
    assert not marks.clear()


@pytest.mark.slow
async def test_the_large_plot_steps_through_its_signals(screen, ran_s=20):
    await screen.enter("/LF torque", "*", "m")
    await screen.curves()
    await screen.press("g", "enter", at="detail")
    first = lambda: screen.app.screen.plots[0].name.split("/")[-2]  # noqa: E731
    assert first() == "HAA"
    for key, joint in (("j", "HFE"), ("j", "KFE"), ("j", "HAA"), ("k", "KFE"), ("g", "HAA"), ("G", "KFE")):
        await screen.press(key)
        assert first() == joint, key
    await screen.shows("LF/KFE/torque")


@pytest.mark.slow
async def test_the_list_of_loggers_moves_looks_again_and_takes_commands(new_fake, opened):
    fakes = [new_fake(name=name) for name in ("arm", "base", "legs")]
    async with opened(*fakes, ready=False) as screen:
        await screen.shows("legs")
        lines = screen.app.screen.query_one("#list-lines")
        for key, at in (("G", 2), ("g", 0), ("end", 2), ("home", 0)):
            await screen.press(key)
            assert lines.highlighted == at, key
        await screen.press("r", ":")
        await screen.enter("nonsense", shows="there is no command 'nonsense'")
        await screen.press(":")
        await screen.enter("settings", at="settings")


class TestWhatAKeyIsAbout:
    def test_the_marked_lines_that_are_shown_in_the_order_shown(self):
        marks = Marks()
        marks.keys = {"a", "c", "hidden"}
        assert marks.meant(["c", "b", "a"], "b") == ["c", "a"]
        assert marks.why_none(["c", "b", "a"], "b") == ""

    def test_nothing_where_all_that_is_marked_is_filtered_out(self):
        marks = Marks()
        marks.keys = {"a"}
        assert marks.meant(["b"], "b") == []
        assert marks.why_none(["b"], "b").startswith("the filter leaves out what is marked")

    def test_the_line_under_the_cursor_where_nothing_is_marked(self):
        assert Marks().meant(["a", "b"], "b") == ["b"]
        assert Marks().meant([], "") == []

    def test_the_cursor_goes_with_its_line(self):
        marks = Marks()
        assert marks.follow("b", ["new", "a", "b"], 1) == 2
        assert marks.meant(["new", "a", "b"], "b") == ["b"]

    def test_not_the_line_that_slipped_under_the_cursor_until_the_key_comes_again(self):
        marks = Marks()
        assert marks.follow("b", ["a", "c"], 1) == 1
        assert marks.meant(["a", "c"], "c") == []
        assert (
            marks.why_none(["a", "c"], "c") == "b is gone, c stands there now: nothing was done; once more is about it"
        )
        assert marks.meant(["a", "c"], "c") == ["c"]

    def test_the_line_that_one_moves_to_after_that(self):
        marks = Marks()
        marks.follow("b", ["a", "c"], 1)
        assert marks.meant(["a", "c"], "a") == ["a"]

    def test_who_changed_what_is_shown_means_what_stands_there(self):
        marks = Marks()
        marks.follow("b", ["a", "c"], 1)
        marks.settle()
        assert marks.meant(["a", "c"], "c") == ["c"]


SECOND = 10**9


class Case(NamedTuple):
    """A list, known by the command that leads to it: words of its lines as they stand, and what keys make of them."""

    scope: str
    lines: str
    filtered: tuple[str, str]  # what is typed, and what is left
    ordered: tuple[tuple[str, str], ...]  # a letter, and how they stand then
    about: tuple[str, ...] = ()  # commands about what is marked


CASES = (
    Case(
        "triggers", "low fall spin", ("-roll", "low spin"),
        (("n", "fall low spin"), ("n", "spin low fall"), ("c", "fall spin low"), ("l", "fall spin low")),
        ("trigger_remove", "trigger_toggle", "trigger_force"),
    ),
    Case(
        "alarms", "torque cold", ("cold", "cold"), (("n", "cold torque"), ("c", "torque cold"), ("c", "cold torque")),
        ("acknowledge",),
    ),
    Case(
        "events", "cid ann bob", ("-E", "cid ann"),
        (("k", "ann cid bob"), ("w", "ann bob cid"), ("t", "cid ann bob"), ("t", "bob ann cid")),
    ),
    Case(
        "recordings", "fall op1 died", ("robot -fall", "op1 died"),
        (("s", "op1 died fall"), ("s", "fall died op1"), ("z", "died fall op1"), ("w", "died op1 fall")),
        ("delete_recording", "fetch_recording"),
    ),
    Case(
        "parameters", "height trot kp fixed", ("gains", "kp fixed"),
        (("n", "fixed kp height trot"), ("n", "trot height kp fixed"), ("c", "kp height trot fixed")),
        ("default_parameter",),
    ),
)  # fmt: skip


@pytest.fixture
def listed(fake, monkeypatch):
    """A logger of which every list has some lines."""
    fake.run(20)
    now_ns = fake.now_ns
    options = TriggerOptions("fall", "abs(base/roll) > 0.6")
    fake.trigger_statuses = [
        TriggerStatus(TriggerOptions("low", "diff(voltage) < -0.5"), TriggerWord.BLIND, why="it is off"),
        TriggerStatus(options, TriggerWord.ARMED, fires=3, last_ns=now_ns),
        TriggerStatus(TriggerOptions("spin", "norm(imu/rate) > 3"), TriggerWord.OFF),
    ]
    fake.limit_statuses = [
        LimitStatus("/log/LF/HAA/torque", "", LimitWord.RED_HIGH, value=84.2, count=12, alarm=True),
        LimitStatus("/log/a/cold", "", LimitWord.YELLOW_LOW, value=1.0, count=9, alarm=True),
    ]
    for kind, who in (("edited", "bob"), ("marker", "ann"), ("lost", "cid")):
        fake.happen(kind, f"by {who}", now_ns, who=who)
    told = (("fall", "trigger fall", 3.0, 200), ("s", "saved by op1", 25.0, 100), ("d", "program died", 6.0, 300))
    rows = [
        SavedRecording(stem, [RecordingFile(f"{stem}.silo", FileType.SILO, size, now_ns)], now_ns - place * SECOND,
                       span_s, why, "robot", 0, own=True)
        for place, (stem, why, span_s, size) in enumerate(told)
    ]  # fmt: skip
    monkeypatch.setattr(fake, "recordings", lambda most=1000: Recordings("/home/ann/logs", rows, 3))
    fake.put({"/log/gains/kp": 60.0})
    return fake


async def at_list(screen, case):
    await screen.do(case.scope)
    await screen.until(lambda: standing(screen, case) == case.lines, "the lines")


def standing(screen, case):
    """Which lines stand on the screen, by their words."""
    at = screen.app.screen.query("#list-lines").first().region if screen.app.screen.query("#list-lines") else None
    rows = screen.text.splitlines()[at.y : at.bottom] if at else []
    return " ".join(word for row in rows for word in case.lines.split() if word in row)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[case.scope for case in CASES])
async def test_a_list_is_filtered_and_ordered_and_keys_are_about_nothing_that_is_not_seen(case, listed, opened):
    async with opened(listed) as screen:
        await at_list(screen, case)
        typed, left = case.filtered
        await screen.do("list_filter", shows="Esc clears it")
        await screen.enter(typed)
        assert "Esc clears it" not in screen.text
        assert standing(screen, case) == left
        assert f"/{typed}: {len(left.split())} of {len(case.lines.split())}" in screen.text
        await screen.press("escape")
        assert (standing(screen, case), screen.app.screen.scope) == (case.lines, case.scope)

        for letter, lines in case.ordered:
            await screen.do("list_order", letter)
            assert standing(screen, case) == lines, letter

        marked, *_, seen = case.ordered[-1][1].split()
        await screen.do("list_top", "list_mark", "list_filter")
        await screen.enter(seen)
        for command in case.about:
            await screen.do(command)
            assert "the filter leaves out what is marked" in screen.text, (command, marked)
        assert not screen.app.screen.is_modal
        assert not listed.calls
