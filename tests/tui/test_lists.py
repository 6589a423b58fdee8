"""Lists: filter, order and marks as rules; the keys of the large plot and of the list of loggers on the screen."""

import pytest

from silo_tui.model.lists.ordering import Marks, Order, arranged, passes

SHOWN = ["a", "b", "c", "d"]


@pytest.mark.parametrize(
    ("asked", "found"),
    [("", True), ("fall", True), ("FALL roll", True), ("slip|roll", True), ("-slip", True), ("-roll", False),
     ("slip", False), ("-", False)],
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
async def test_the_large_plot_steps_through_its_signals(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await screen.type("/LF torque")
        await screen.press("enter", "*", "m")
        await screen.until(lambda: not screen.app.screen.stack.store.empty, "plots")
        await screen.press("g", "enter")
        await screen.until(lambda: screen.app.screen.scope == "detail", "the large plot")
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
        await screen.type("nonsense")
        await screen.press("enter")
        await screen.shows("there is no command 'nonsense'")
        await screen.press(":")
        await screen.type("settings")
        await screen.press("enter")
        await screen.until(lambda: screen.app.screen.scope == "settings", "what was typed")


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
