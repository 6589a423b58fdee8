"""The pane about the element under the cursor, without an app: its facts, why there is no value, its small plots."""

from types import SimpleNamespace
from typing import Any, cast

import msgspec
import numpy as np
import pytest
from rich.style import Style
from textual.geometry import Region
from textual.widget import Widget

from silo.analysis.reports import ElementReport
from silo.core.arrays.columns import ColumnStore, HistoryColumns
from silo.core.elements import State
from silo.core.recording import Failures
from silo.rpc.published import NOT_LIVE_TEXTS, NotLive
from silo_tui.model.samples.live import Reading
from silo_tui.model.table.fields import Field
from silo_tui.terminal.thinness import Pace
from silo_tui.widgets import inspector
from silo_tui.widgets.inspector import Inspector, beside, cut_to
from tests.stand_ins.desk import Desk, Drawn
from tests.stand_ins.fake_signals import scalar, vector

HEAT, GAIT, TURN = "/log/imu/temperature", "/log/state/gait", "/log/base/orientation"


class Pane(Drawn, Inspector):
    """The pane."""

    rich_style = Style.null()

    def refresh(self, *_: Any, **__: Any) -> "Pane":
        return self


def pane(desk: Desk, name: str = HEAT, width: int = 40, height: int = 24, *, below: bool = False) -> Pane:
    shown = Pane(cast(Any, CursorOn(desk.session, name)))
    shown.width, shown.height, shown.below = width, height, below
    return shown


class CursorOn:
    """A session whose cursor is on an element."""

    def __init__(self, session: Any, name: str) -> None:
        self._session = session
        self.rows = SimpleNamespace(row=session.table.row(name))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)


def lines(shown: Pane) -> list[str]:
    return [shown.render_line(y).text.rstrip() for y in range(shown.height)]


def words(shown: Pane) -> str:
    return "\n".join(lines(shown)).rstrip()


def reads(desk: Desk, name: str, *values: float, **more: Any) -> None:
    """The newest values of an element."""
    told = {"texts": {}, "held": 50, "lost": 0, "time_ns": 0, **more}
    desk.session.live.readings[name] = Reading(np.array(values, float), **told)


@pytest.fixture
def desk(fake):
    return Desk(fake.run())


# --------------------------------------------------------------------------------------------------------------- facts

FACTS = """\
/imu/temperature
scalar f8 [degC]
logging      on
divider      40
action       save and publish
buffer       looping
size         100
which holds  10 s at 10 Hz
"""


def test_the_pane_tells_what_an_element_is_and_what_it_holds(desk):
    assert words(pane(desk)) == f"{FACTS}\nno values yet"
    reads(desk, HEAT, 21.5)
    assert words(pane(desk)) == f"{FACTS}held         50 ████     50%\n\n21.5000"
    assert words(pane(desk, width=33)).split("\n")[8] == "held         50 ██   50%"
    assert words(pane(desk, width=34)).split("\n")[8] == "held         50 ████     50%"


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ({"lost": 3}, "lost         3"), ({"failed": 1}, "not read     at 1 tick"),
        ({"size": 200}, "held         50 ██       25%"), ({"held": 400}, "held         400 ████████ 100%"),
    ],
)  # fmt: skip
def test_what_was_lost_or_not_read_of_an_element_is_told(more, line, desk):
    reads(desk, HEAT, 21.5, **more)
    assert line in lines(pane(desk))


def test_an_edit_stands_beside_what_is_and_says_who_else_changed_it(desk):
    desk.edit(HEAT, 80)
    assert "divider      40 → 80" in lines(pane(desk))
    assert "which holds  20 s at 5 Hz" in lines(pane(desk))
    desk.fake.somebody_edits(HEAT, divider=20)
    desk.session.table.load(desk.fake.table())
    assert "divider      20 → 80 ! changed by someb…" in lines(pane(desk))


def test_an_element_is_described_and_its_name_goes_on_in_the_next_line(new_fake):
    long = scalar("/log/a/b", "-")
    described = msgspec.structs.replace(long, description="of the left knee")
    other = vector("/log/" + "name" * 5, "m")
    desk = Desk(new_fake([described, other]))
    assert lines(pane(desk, "/log/a/b"))[:3] == ["/a/b", "scalar f8", "of the left knee"]
    assert lines(pane(desk, other.name, width=12))[:3] == ["/namenamenam", "enamename", "vector 3 f8…"]


def test_a_derived_signal_is_told_of_without_a_buffer(fake):
    fake.derive("hot", "imu/temperature > 3")
    desk = Desk(fake)
    name = desk.session.table.names[-1]
    shown = words(pane(desk, name))
    assert "logging" in shown
    assert not any(each in shown for each in ("action", "buffer", "size", "which holds"))
    assert "not running; S starts it" in shown


def test_without_a_row_there_is_nothing(desk):
    shown = pane(desk)
    shown.session.rows.row = None
    assert words(shown) == ""
    assert shown.plot_names() == []


# --------------------------------------------------------------------------------------------------------------- values


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, "no values yet"),
        ({"state": State.STOPPED}, "not running; S starts it"),
    ],
)
def test_why_there_is_no_value_is_told(change, says, desk):
    desk.session.status = msgspec.structs.replace(desk.session.status, **change)
    assert lines(pane(desk))[9] == says
    reads(desk, HEAT, 21.5, held=0)
    assert lines(pane(desk))[10] == says
    reads(desk, HEAT, 21.5, held=1)
    assert lines(pane(desk))[10] == "21.5000"


def test_of_what_is_off_it_is_told_how_it_is_switched_on(desk):
    desk.session.table.server[Field.ENABLED, desk.session.table.row(HEAT)] = 0
    assert "not logged; e t switches it on" in lines(pane(desk))
    assert pane(desk).plot_names() == []


def test_a_value_that_is_not_of_now_says_why(desk):
    reads(desk, HEAT, 21.5, why=next(iter(NotLive)))
    shown = words(pane(desk, width=80))
    assert shown.endswith(f"\n{NOT_LIVE_TEXTS[next(iter(NotLive))]}\n21.5000")


def test_each_entry_of_a_vector_has_its_line(desk):
    reads(desk, TURN, 1.0, 0.5, -0.25, 0.0, held=4000)
    assert lines(pane(desk, TURN))[10:14] == [
        "x           1.0000",
        "y           0.5000",
        "z          -0.2500",
        "w           0.0000",
    ]


def test_a_label_stands_for_its_number(desk):
    reads(desk, GAIT, 1.0)
    assert words(pane(desk, GAIT)).endswith("\nwalk")


@pytest.mark.parametrize(("count", "more"), [(16, "no such line"), (17, "and 1 more; m plots them")])
def test_of_many_entries_the_first_are_told_and_the_rest_counted(count, more, new_fake):
    many = vector("/log/a/many", "m", "abcdefghijklmnopq"[:count])
    desk = Desk(new_fake([many, scalar("/log/b")]).run())
    reads(desk, many.name, *range(count))
    shown = lines(pane(desk, many.name, height=40))
    assert sum(line.startswith(tuple("abcdefghijklmnopq")) and len(line.split()) == 2 for line in shown) >= 16
    assert (more in shown) is (count == 17)


# ------------------------------------------------------------------------------------------------------------ of a file


def report(**more: Any) -> ElementReport:
    told = {"type": "f8", "kind": "scalar", "divider": 40, "buffer": "looping", "samples": 1200, "start_s": 0.0,
            "end_s": 9.5, "rate_hz": 10.0, "lost": 0, **more}  # fmt: skip
    return ElementReport(HEAT, "degC", **told)


@pytest.mark.parametrize(
    ("more", "shown"),
    [
        ({}, ["divider   40", "samples   1 200", "rate      10 Hz", "buffer    looping", "lost      0"]),
        ({"failures": Failures(2, ((0, 1),))}, ["not read  at 2 ticks"]),
        ({"rate_hz": None, "lost": 1200}, ["rate      -", "lost      1 200"]),
        ({"labels": {at: "abcdefghij"[at] for at in range(8)}}, ["0 a, 1 b, 2 c, 3 d, 4 e, 5 f, 6 g, 7 h"]),
        ({"labels": {at: "abcdefghij"[at] for at in range(9)}}, ["0 a, 1 b, 2 c, 3 d, 4 e, 5 f, 6 g, 7 h, …"]),
    ],
)
def test_of_a_file_it_is_told_what_it_has_of_an_element(more, shown, desk):
    one = pane(desk, width=44)
    one.session.at_s, one.session.rows_of = 1.25, {HEAT: report(**more)}
    assert set(shown) <= set(lines(one))


@pytest.mark.parametrize(
    ("samples", "held", "says"),
    [(0, None, "no samples in this file"), (9, None, "no sample yet"), (9, 0, "no sample yet"), (9, 1, "21.5000")],
)
def test_of_a_file_it_is_told_what_was_there_at_the_moment(samples, held, says, desk):
    if held is not None:
        reads(desk, HEAT, 21.5, held=held)
    one = pane(desk)
    one.session.at_s, one.session.rows_of = 1.25, {HEAT: report(samples=samples)}
    assert words(one).endswith(f"\n\nat 1.25 s:\n{says}")


# ---------------------------------------------------------------------------------------------------------------- plots


def plotted(desk: Desk, *names: str, count: int = 80) -> None:
    """What the pane has to plot: a ramp from 0 to 10."""
    store = ColumnStore(names, count, 100_000_000)
    ramp = np.tile(np.linspace(0.0, 10.0, count), (len(names), 1))
    store.take(HistoryColumns(tuple(names), 0, 100_000_000, ramp, ramp))
    desk.session.columns = store


def test_small_plots_stand_below_with_their_range_and_span(desk):
    plotted(desk, HEAT)
    shown = lines(pane(desk))
    assert shown[10].startswith("value  0 … 10  ")
    assert all(shown[11:18])
    assert shown[18:] == [""] * 6


@pytest.mark.parametrize(
    ("height", "titles"),
    [(26, [10, 14, 18, 22]), (22, [10, 14, 18]), (21, [10, 15]), (18, [10, 14]), (17, [10]), (14, [10]), (13, [])],
)
def test_there_are_as_many_plots_as_have_room(height, titles, desk):
    names = [f"{TURN}_{each}" for each in "xyzw"]
    plotted(desk, *names)
    shown = lines(pane(desk, TURN, height=height))
    assert [at for at, line in enumerate(shown) if "  0 … 10  " in line] == titles


def test_what_is_not_of_now_is_quiet(desk):
    plotted(desk, HEAT)
    shown, quiet = pane(desk), {}
    for now in (True, False):
        if not now:
            desk.session.lose()
        shown.live_changed()
        shown._lines = shown._plotted_of = None
        quiet[now] = shown.render_line(12)._segments[0].style.color
    assert quiet[True] != quiet[False]


def test_of_a_file_what_was_lost_is_told_loudly(desk):
    one = pane(desk)
    one.session.at_s, one.session.rows_of = 1.25, {HEAT: report(lost=3)}
    told = {line: one.render_line(at)._segments[1].style.color for at, line in enumerate(lines(one)) if at in (1, 9)}
    assert sorted(told) == ["kind      scalar", "lost      3"]
    assert len(set(told.values())) == 2


def test_texts_are_not_plotted(desk):
    assert pane(desk, "/log/state/operator").plot_names() == []
    assert pane(desk, TURN).plot_names() == [f"{TURN}_{each}" for each in "xyzw"]


@pytest.mark.parametrize(("width", "spread"), [(53, False), (54, True)])
def test_a_wide_pane_below_the_table_has_values_and_plots_beside_the_facts(width, spread, desk):
    reads(desk, HEAT, 21.5)
    plotted(desk, HEAT)
    shown = pane(desk, width=width, height=12, below=True)
    assert shown.spread is spread
    assert shown.plot_width == (27 if spread else width)
    second = lines(shown)[1]
    assert second == (f"{'scalar f8 [degC]':<27}21.5000" if spread else "scalar f8 [degC]")
    assert lines(shown)[2].startswith(f"{'logging      on':<27}value  3 … 10  5.4 s") is spread


def test_beside_the_facts_plots_have_the_room_below_the_values(desk):
    reads(desk, TURN, 1.0, 0.5, -0.25, 0.0)
    plotted(desk, *(f"{TURN}_{each}" for each in "xyzw"))
    shown = lines(pane(desk, TURN, width=80, height=13, below=True))
    assert [at for at, line in enumerate(shown) if "  0 … 10  " in line] == [5, 9]


def test_plots_are_drawn_once_a_second_and_at_once_where_all_is_painted(desk, monkeypatch):
    clock = SimpleNamespace(s=100.0)
    monkeypatch.setattr(inspector.time, "monotonic", lambda: clock.s)
    monkeypatch.setattr(Widget, "refresh", lambda self, *_, **__: self)
    plotted(desk, HEAT)
    shown = pane(desk)
    before = lines(shown)
    ramp = np.linspace(0.0, 50.0, 80)[None]
    desk.session.columns.take(HistoryColumns((HEAT,), 0, 100_000_000, ramp, ramp))
    clock.s += Pace().trend_s - 0.1
    shown.live_changed()
    assert lines(shown) == before
    clock.s += 0.1
    shown.live_changed()
    assert lines(shown)[10].startswith("value  0 … 50")
    ramp = np.linspace(0.0, 90.0, 80)[None]
    desk.session.columns.take(HistoryColumns((HEAT,), 0, 100_000_000, ramp, ramp))
    Inspector.refresh(shown, Region(0, 1, 1, 1))
    assert lines(shown)[10].startswith("value  0 … 50")
    Inspector.refresh(shown)
    assert lines(shown)[10].startswith("value  0 … 100")


@pytest.mark.parametrize(
    ("left", "room", "line"),
    [("abc", 6, "abc   right"), ("abcde", 6, "abcde right"), ("abcdef", 6, "abcd… right"), ("", 6, "      right")],
)
def test_what_is_too_long_beside_something_is_cut(left, room, line):
    (found,) = beside([[(left, "")]], [[("right", "")]], room)
    assert "".join(words for words, _ in found) == line


@pytest.mark.parametrize(
    ("words", "room", "cut"), [("abc", 3, "abc"), ("abc", 2, "a…"), ("漢字", 3, "漢…"), ("a", 0, "")]
)
def test_words_are_cut_by_cells(words, room, cut):
    assert cut_to(words, room) == cut


def test_only_lines_that_read_differently_are_painted(desk, monkeypatch):
    reads(desk, HEAT, 21.5)
    shown = pane(desk)
    lines(shown)
    reads(desk, HEAT, 22.5)
    painted: list[int] = []
    monkeypatch.setattr(Widget, "refresh", lambda self, *regions, **_: painted.extend(one.y for one in regions))
    shown.live_changed()
    assert painted == [10]
    shown.session.rows.row = None
    painted.clear()
    shown.live_changed()
    assert painted == list(range(11))


@pytest.mark.slow
async def test_beside_the_inspector_settings_and_names_keep_their_room(screen, ran_s=12, size=(160, 50)):
    """What a table of that width shows: on a wide screen statistics beside it took the room of both."""
    table = screen.app.screen.table
    assert "mean" in screen.text
    await screen.do("inspector")
    await screen.until(lambda: table.laid.width < 120, "a narrower table")
    assert set(table.field_spans()) == set(Field)
    assert table.laid.told.names.longest <= table.laid.names, "all names are whole"


@pytest.mark.slow
async def test_beside_the_table_a_description_is_whole_in_some_lines(new_fake, opened):
    words = "left front knee flexion: difference of the two encoders, before and behind the gear"
    fake = new_fake([msgspec.structs.replace(scalar("/log/x"), description=words)])
    async with opened(fake.run(), size=(160, 50)) as screen:
        await screen.do("inspector")
        await screen.until(
            lambda: words in " ".join(line[line.rfind("│") + 1 :].strip() for line in screen.text.splitlines())
        )
