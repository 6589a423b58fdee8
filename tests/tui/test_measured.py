"""What is measured, on the table's screen: signs, columns, orders, the tree."""

import itertools
import re

import numpy as np
import pytest

from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.elements import ElementInfo, ElementOptions, Entry, Table
from silo.core.quantities.writing import wall_clock
from silo.live.quantities import FROZEN, NOT_FINITE, SLOW
from silo_tui.model.table.state import TableState, against_siblings
from silo_tui.screens import table
from silo_tui.sessions.live import LiveSource
from silo_tui.terminal.thinness import STEPS
from silo_tui.widgets.inputs import CellEditor
from tests.stand_ins.fake_signals import scalar, vector

pytestmark = pytest.mark.slow  # each walks through the whole app

TORQUE = "/log/legs/LF/HAA/torque"


async def test_signs_stand_in_their_column_with_statistics_beside(fake, opened):
    fake.run()
    fake.facts = {"signs": {"/log/base/position": NOT_FINITE}, "most": {"/log/base/position": 86.25}}
    async with opened(fake) as screen:
        await screen.press("C", shows="86.25")
        line = next(line for line in screen.text.splitlines() if "/base/position" in line)
        assert " nan " in line
        assert "columns: statistics of every sample" in screen.text


@pytest.mark.parametrize("width", [80, 160])
async def test_each_press_brings_other_columns(width, fake, opened):
    async with opened(fake, size=(width, 30)) as screen:
        heads = [screen.text.splitlines()[1]]
        for _ in range(3):
            await screen.press("C", shows="columns: ")
            heads.append(screen.text.splitlines()[1])
        assert all(one != other for one, other in itertools.pairwise(heads)), heads
        assert len({re.sub(r"mean \d*s? *", "", head) for head in heads}) == 3
        assert sum("trend" in head for head in heads[:3]) == (2 if width == 160 else 0)


async def test_a_slow_loop_is_one_word_in_the_head_not_a_sign_of_each_row(fake, opened):
    fake.run()
    fake.measured_hz = 0.9 * fake.status().frequency_hz
    fake.facts = {"signs": {element.name: SLOW for element in fake.elements} | {"/log/base/position": SLOW | FROZEN}}
    async with opened(fake) as screen:
        await screen.until(lambda: lines_with(screen, "frozen"), "the other sign")
        assert [" Hz slow" in line for line in lines_with(screen, "slow")] == [True]


async def test_a_slow_element_of_a_loop_at_its_rate_has_its_sign(fake, opened):
    fake.run()
    fake.facts = {"signs": {"/log/base/position": SLOW}}
    async with opened(fake) as screen:
        await screen.until(lambda: any(" slow" in line for line in lines_with(screen, "/base/position")), "its sign")
        await screen.press("j", shows="slow: fewer samples")


async def test_an_order_is_two_keys_by_value_it_goes_to_the_largest_by_name_it_leaves_the_cursor(fake, opened):
    fake.run()
    fake.facts = {"value": {TORQUE: 999.0}}
    async with opened(fake) as screen:
        await screen.press("o", shows="letter again")
        await screen.press("v")
        await screen.until(lambda: screen.session.table.names[screen.session.rows.shown[0]] == TORQUE)
        await screen.shows("by value ↓")
        assert screen.session.rows.position == 0
        await screen.press("o", "l")
        await screen.enter("/torque", "escape", "j", "o", "v")
        await screen.until(lambda: screen.session.rows.row == screen.session.table.row(TORQUE), "the largest")
        assert screen.session.rows.position == 0
        for _ in range(2):  # again turns it round
            await screen.press("o", "l")
            assert screen.session.rows.row == screen.session.table.row(TORQUE)
        assert screen.session.rows.position > 0


async def test_what_rows_are_ordered_by_has_a_column_whatever_the_columns_are(screen, ran_s=12, size=(80, 24)):
    for order in ("std", "fill", "jitter", "div"):
        screen.app.screen.show_set("statistics" if order == "div" else "settings")
        assert f"↓{order}" not in screen.text
        screen.app.screen._order_by(order)
        await screen.shows(f"↓{order}")
        screen.app.screen._order_by("tree")
        await screen.until(lambda order=order: f"↓{order}" not in screen.text)


async def test_rows_stand_still_for_three_seconds_after_a_key_and_the_cursor_on_its_element_or_at_the_top(
    fake, screen, ran_s=12
):
    await screen.press("o", "v")
    rows, table = screen.session.rows, screen.session.table
    await screen.until(lambda: table.facts.of("value", len(table)) is not None)
    await screen.press("j", "j", shows="by value ↓ (stands still 3 s after a key); o l: by name")
    element, order = rows.row, list(rows.shown)
    fake.facts = {"value": {table.names[row]: float(place) for place, row in enumerate(order)}}
    top = screen.app.screen
    await screen.until(lambda: table.facts.of("value", len(table))[order[-1]] == len(order) - 1)
    assert list(rows.shown) == order
    top._typed_s -= 10
    await screen.until(lambda: list(rows.shown) == order[::-1], "the new order")
    assert rows.row == element
    await screen.press("home", "j", "k")
    order = list(rows.shown)
    fake.facts = {"value": {table.names[row]: float(place) for place, row in enumerate(order)}}
    await screen.until(lambda: table.facts.of("value", len(table))[order[-1]] == len(order) - 1)
    screen.app.screen._typed_s -= 10
    await screen.until(lambda: list(rows.shown) == order[::-1], "the new order")
    assert rows.position == 0


async def test_a_measured_filter_is_judged_by_itself(fake, opened):
    fake.run()
    fake.facts = {"value": {TORQUE: 1e6}}
    async with opened(fake) as screen:
        await screen.type("/value>500k")
        await screen.until(lambda: len(screen.session.rows.shown) == 1)
        fake.facts = {"value": {TORQUE: 1e6, "/log/base/position": 2e6}}
        await screen.until(lambda: len(screen.session.rows.shown) == 2)


async def test_that_none_passes_is_said_of_what_is_measured_only_and_as_long_as_none_is_shown(fake, opened):
    fake.run()
    fake.facts = {"changed": {TORQUE: 900.0}}
    none = "No element passes"
    async with opened(fake) as screen:
        await screen.until(lambda: screen.session.rows.is_measured)
        await screen.type("/frozen", shows=none)
        for keys in ("ctrl+u", *"-changed<10m"):
            await screen.press(keys)
            assert (none in screen.text) == (not len(screen.session.rows.shown)), keys
        await screen.until(lambda: len(screen.session.rows.shown) == 1)
        assert none not in screen.text
        fake.facts = {"changed": {}}
        await screen.shows(none)
        fake.facts = {"changed": {TORQUE: 900.0}}
        await screen.until(lambda: len(screen.session.rows.shown) == 1)
        await screen.until(lambda: none not in screen.text)


async def test_z_makes_a_tree_that_folds_and_edits_as_a_whole(fake, opened):
    fake.run()
    fake.facts = {"signs": {TORQUE: FROZEN}}
    async with opened(fake) as screen:
        await screen.press("o", "n", shows="▼ base")
        await screen.enter(":goto LF/HAA/torque", "z", shows="► HAA")
        await screen.shows("frozen 1 of 5")
        line = next(line for line in screen.text.splitlines() if "► HAA" in line)
        assert "frozen 1 of 5" in line
        await screen.press("t")
        assert screen.session.table.pending_count == (5, 5)


def over(name, word):
    return LimitStatus(name, name, word, value=9.0, count=1)


async def test_a_folded_branch_counts_what_is_beyond_its_limits_below_it(fake, opened):
    fake.run()
    fake.facts = {"signs": {TORQUE: FROZEN}}
    fake.limit_statuses = [
        over("/log/legs/LF/HAA/velocity", LimitWord.RED_HIGH), over("/log/legs/LF/HFE/torque", LimitWord.YELLOW_LOW)
    ]  # fmt: skip
    async with opened(fake) as screen:
        await screen.press("o", "n")
        await screen.enter(":goto LF/HAA/torque", "z")
        await screen.until(lambda: "HH 1 of 5" in next(iter(lines_with(screen, "► HAA")), ""), "the branch's sign")
        await screen.press("k", "z")
        await screen.until(lambda: "HH 1 of 16" in next(iter(lines_with(screen, "► LF")), ""), "the branch above")


def lines_with(screen, words):
    return [line for line in screen.text.splitlines() if words in line]


async def test_alarm_is_a_filter_and_worst_first_begins_with_what_is_beyond_a_red_limit(fake, opened):
    fake.run()
    fake.facts = {"signs": {TORQUE: FROZEN, "/log/base/velocity": NOT_FINITE}}
    fake.limit_statuses = [
        over("/log/imu/temperature", LimitWord.RED_LOW), over("/log/legs/RF/HFE/torque", LimitWord.YELLOW_HIGH)
    ]  # fmt: skip
    async with opened(fake) as screen:
        table, rows = screen.session.table, screen.session.rows
        wanted = ["/log/imu/temperature", "/log/base/velocity", "/log/legs/RF/HFE/torque", TORQUE]
        await screen.enter("/alarm")
        await screen.until(lambda: sorted(table.names[row] for row in rows.shown) == sorted(wanted), "they alone")
        await screen.press("escape", "o", "!")
        await screen.until(lambda: [table.names[row] for row in rows.shown[:4]] == wanted, "worst first")
        await screen.until(lambda: " LL " in next(iter(lines_with(screen, "/imu/temperature")), ""), "its sign")


async def test_n_steps_through_norm_and_entries_of_a_vector_and_statistics_of_the_norm_are_marked(screen, ran_s=12):
    await screen.enter(":goto imu/acceleration", "n", shows="norm ")
    await screen.press("n", "n", shows=" y ")
    await screen.press("n", "n")
    await screen.enter("/imu/acceleration", "C", shows="mean")
    await screen.press("n")
    await screen.until(lambda: any("norm " in line for line in screen.text.splitlines()[2:-3]), "the norm, marked")


async def test_zero_begins_the_statistics_anew_and_since_when_they_are_stands_below_them(fake, screen, ran_s=12):
    await screen.until(lambda: screen.session.table.facts.since_ns == fake.since_ns > 0)
    fake.advance(30)
    await screen.press("Z")
    await screen.until(lambda: screen.session.table.facts.since_ns == fake.now_ns)
    assert "statistics since" not in screen.text, "none are shown"
    await screen.press("C")
    screen.app.screen.info.give_way()  # what the set of columns said
    fake.since_ns = fake.now_ns - 720 * 10**9
    await screen.shows(f"statistics since {wall_clock(fake.since_ns)}")
    head = screen.text.splitlines()[1].split()
    assert {"min", "max", "mean", "std"} <= set(head), f"one word for when they begin, below them: {head}"


async def test_the_inspector_gives_way_first_comes_by_i_and_has_the_value_of_its_row_beside_statistics(
    fake, screen, ran_s=12, size=(160, 50)
):
    assert not screen.app.screen.inspector.display
    await screen.press("i")
    assert screen.app.screen.inspector.display
    await screen.press("i")
    await screen.enter(f":goto {TORQUE}")
    screen.app.screen.show_set("statistics")
    fake.facts = {"value": {TORQUE: 1234.5}}
    await screen.do("inspector")
    await screen.until(lambda: screen.text.count("1234.5") == 2)  # in the row, and beside it


@pytest.mark.parametrize("size", [(80, 24), (60, 20), (109, 30)])
async def test_a_narrow_screen_has_the_inspector_below_the_table_with_values_and_plots_beside_the_facts(
    size, screen, ran_s=20
):
    await screen.press("G", "i")
    below = screen.app.screen.inspector
    await screen.until(lambda: below.region.y == screen.app.screen.table.region.bottom, "the inspector below")
    assert (below.region.x, below.region.width) == (0, size[0])
    assert below.region.bottom == size[1] - 2  # above the message and the keys
    last = screen.session.table.elements[screen.session.rows.row]
    # the row under the cursor is still to be seen, and what it is stands below
    shown = [screen.session.short_name(last.name), "divider ", "size ", "4000", "held "]
    await screen.until(lambda: all(words in screen.text for words in shown), "the facts")
    await screen.until(lambda: sum(shown[0] in line for line in screen.text.splitlines()) == 2, "row and facts")
    await screen.enter("//imu/acceleration")
    for words in ("vector 3 f8 [m/s2]", "x ", "y ", "z ", "which holds  10 s at 400 Hz"):
        await screen.shows(words)
    await screen.until(lambda: re.search(r"(vector 3 f8 .*|logging +on) +x ", screen.text), "an entry beside the facts")
    if size[1] >= 24:
        await screen.until(lambda: set("⣿⡇⢸⠉⣀⠃⠘") & set(screen.text), "a plot")
    await screen.press("i")
    await screen.until(lambda: "held " not in screen.text, "the table alone")


async def test_a_table_that_grows_wide_has_the_inspector_beside_it_again(screen):
    await screen.press("i")
    inspector, table = screen.app.screen.inspector, screen.app.screen.table
    await screen.until(lambda: inspector.region.y == table.region.bottom, "below")
    await screen.pilot.resize_terminal(160, 50)
    await screen.until(lambda: inspector.region.x > table.region.x and inspector.region.y < 3, "beside")


async def test_statistics_that_the_table_shows_are_kept_while_plots_are_looked_at(fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.screens.table.KEEP_SURVEY_S", 0.0)
    asked = []
    survey = fake._survey
    fake._survey = lambda quantities, names=(), **more: asked.append((names, more)) or survey(quantities, names, **more)
    async with opened(fake.run()) as screen:
        await screen.plot("m")
        asked.clear()
        await screen.pilot.pause(1.2)
        assert not asked, "nothing is to be kept of a table without statistics"
        await screen.press("escape")
        await screen.do("columns")
        await screen.until(lambda: "mean" in screen.app.screen._quantities, "statistics in the table")
        await screen.until(lambda: fake.since_ns, "their first survey")
        since_ns = fake.since_ns
        await screen.plot("m")
        asked.clear()
        await screen.until(lambda: asked, "a survey that keeps them")
        names, more = asked[0]
        assert list(names) == screen.session.table.names[:1]
        assert not more.get("reset")
        assert fake.since_ns == since_ns


async def test_a_logger_that_knows_no_surveys_is_shown_all_the_same(fake, opened):
    fake.run()
    from silo.rpc.refusals import RefusedWhy
    from tests.stand_ins.fake_signals import refused

    def survey(*arguments, **options):
        raise refused(RefusedWhy.INVALID, "the request can't be understood")

    fake._survey = survey
    async with opened(fake) as screen:
        await screen.shows("no statistics and signs")
        await screen.until(lambda: "/log/base/position" in screen.session.live.readings, "values")
        assert np.isfinite(screen.session.live.readings["/log/base/position"].newest).all()


async def test_statistics_of_an_enumeration_are_its_labels(fake, opened):
    fake.run()
    gait = "/log/state/gait"
    fake.facts = {"min": {gait: 0.0}, "max": {gait: 2.0}, "mean": {gait: 0.7}, "std": {gait: 0.3}}
    async with opened(fake, size=(100, 24)) as screen:
        await screen.enter("/state/gait", "C")
        await screen.until(lambda: "trot" in screen.text and "stand" in screen.text, "labels")
        line = next(line for line in screen.text.splitlines() if "gait" in line and "trot" in line)
        assert "0.7" not in line
        assert line.split().count("-") >= 2


async def test_a_message_leaves_the_count_of_the_filter_beside_it(screen):
    await screen.enter("/torque", "asterisk", "u", shows="nothing to undo")
    line = next(line for line in screen.text.splitlines() if "nothing to undo" in line)
    assert "/torque: " in line


def row_with(screen, words):
    return next((line for line in screen.text.splitlines() if words in line), "")


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_beside_the_entries_of_a_vector_stand_the_least_and_the_most_of_any_and_no_norm(size, fake, opened):
    fake.run()
    name = "/log/imu/acceleration"
    fake.facts = {"least": {name: -7.5}, "most": {name: 8.25}, "max": {name: 99.0}, "mean": {name: 55.0}}
    async with opened(fake, size=size) as screen:
        if "mean" not in screen.text:
            await screen.press("C")
        await screen.until(lambda: "8.25" in row_with(screen, "/imu/acceleration"))
        line = row_with(screen, "/imu/acceleration")
        assert "-7.50" in line
        assert "norm" not in line
        assert "99." not in line
        assert "55." not in line


async def test_of_a_pose_there_is_no_norm(new_fake, opened):
    pose = "/log/base/pose"
    entries = tuple(Entry(suffix, "<f8") for suffix in ("_position_x", "_position_y", "_orientation_w"))
    fake = new_fake([ElementInfo(pose, "m", "pose", (3,), entries, ElementOptions())])
    fake.run()
    fake.facts = {"value": {pose: 77.0}, "max": {pose: 77.0}, "most": {pose: 77.0}}
    async with opened(fake, size=(120, 24)) as screen:
        await screen.press("C", "n", shows=" position_x ")
        await screen.press("o", "v")
        await screen.until(lambda: screen.session.table.facts.of("value", 1) is not None)
        assert "77." not in screen.text
        assert "norm " not in screen.text


async def test_value_and_statistics_of_a_row_are_of_one_moment_and_have_decimals_alike(fake, opened):
    fake.run()
    fake.facts = {"value": {TORQUE: 11.125}, "max": {TORQUE: 11.125}, "min": {TORQUE: 11.125}}
    async with opened(fake) as screen:
        await screen.enter("/LF/HAA/torque", "C")
        await screen.until(lambda: row_with(screen, "HAA/torque").count("11.1250") == 3, "three numbers that agree")
        fake.facts |= {"max": {TORQUE: 31.5}, "min": {TORQUE: 1.78e-15}, "mean": {TORQUE: 2.5}}
        await screen.until(lambda: re.search(r"11\.1[23] +0\.00 +31\.50 +2\.50", row_with(screen, "HAA/torque")))


async def test_ordered_by_value_the_values_are_those_of_the_order_after_a_filter_too(fake, opened):
    fake.run()
    legs = [info.name for info in fake.infos if info.name.endswith("torque")]
    fake.facts = {"value": {name: float(10 * place) for place, name in enumerate(legs)}}
    async with opened(fake) as screen:
        await screen.press("o", "v")
        await screen.enter("/torque", shows=f"{10.0 * (len(legs) - 1):.4f}")
        shown = [float(found) for found in re.findall(r"torque.*?(\d+\.\d{4})", screen.text)]
        assert len(shown) == len(legs)
        assert shown == sorted(shown, reverse=True)


async def test_samples_that_are_no_numbers_are_told_of_the_row_under_the_cursor(fake, opened):
    fake.run()
    fake.facts = {"bad": {TORQUE: 12.0}}
    async with opened(fake, size=(120, 24)) as screen:
        await screen.enter("/LF/HAA/torque", "C", "j")
        await screen.until(lambda: screen.session.table.facts.detail(TORQUE, "bad") == 12.0)
        screen.app.screen.say("")
        await screen.shows("12 samples nan or inf: min to std leave nan out")


async def test_least_and_most_of_whole_numbers_are_whole(new_fake, opened):
    fake = new_fake([scalar("/log/solver/iterations", dtype="<i4")])
    fake.facts = {"min": {"/log/solver/iterations": 5.0}, "max": {"/log/solver/iterations": 28.0}}
    async with opened(fake.run()) as screen:
        await screen.press("C")
        await screen.until(lambda: re.search(r" 5 +28 +-?\d+\.\d\d ", row_with(screen, "/solver/iterations")))


async def test_entries_beside_statistics_are_of_their_moment(fake, opened):
    name = "/log/imu/acceleration"
    fake.run()
    fake.facts = {"value": {f"{name}_x": 7.25, f"{name}_y": 8.25, f"{name}_z": 9.25}, "most": {name: 9.25}}
    async with opened(fake, size=(160, 50)) as screen:
        await screen.until(lambda: "7.25  8.25  9.25" in row_with(screen, "/imu/acceleration"))


@pytest.mark.parametrize(("size", "entries"), [((80, 24), 3), ((120, 24), 6)])
async def test_what_names_don_t_need_shows_entries_of_vectors(size, entries, new_fake, opened):
    fake = new_fake([vector("/log/base/twist", "m/s", "abcdef"[:entries]), scalar("/log/legs/LF/KFE/velocity")])
    async with opened(fake.run(), size=size) as screen:
        await screen.until(lambda: len(re.findall(r"-?\d\.\d\d\b", row_with(screen, "/base/twist"))) == entries)
        assert "…" not in row_with(screen, "/base/twist")


async def test_a_unit_that_has_no_room_is_never_cut(new_fake, opened):
    """The inspector tells it: `kg m^` would be another."""
    async with opened(new_fake([scalar("/log/base/inertia", unit := "kg m^2/s^2 per turn")])) as screen:
        await screen.shows("inertia")
        assert "kg" not in screen.text and "unit" not in screen.text.splitlines()[1], "nor a column of ellipses"
        await screen.do("inspector", shows=f"[{unit}]")


@pytest.mark.parametrize(("pace", "spared_s"), [(STEPS[0], 0.0), (STEPS[-1], 8.0)])
async def test_a_link_is_spared_by_surveys_where_it_is_thin_alone(monkeypatch, pace, spared_s, screen):
    monkeypatch.setattr("silo_tui.screens.table.pace_of", lambda app: pace)
    assert screen.app.screen._thin_s() == spared_s


@pytest.mark.parametrize("keys", [("m",), ("f2",), ("E",), ("m", "enter")])
async def test_goto_leads_to_the_table_from_any_screen_and_one_that_finds_nothing_leaves_none(keys, screen, ran_s=2):
    await screen.press(*keys)
    await screen.until(lambda: screen.app.screen.scope not in ("", "table"), "another screen")
    elsewhere = screen.app.screen
    await screen.enter(":goto nowhere", shows="no element has 'nowhere' in its name")
    assert screen.app.screen is elsewhere
    await screen.enter(":goto temperature IMU")
    await screen.until(lambda: screen.app.screen.scope == "table", "the table")
    await screen.shows(">/imu/temperature")


async def test_in_a_tree_goto_leads_to_a_name_space_itself_with_what_it_holds_below_it(screen):
    await screen.press("o", "n")
    await screen.enter(":goto RF", shows="/legs/RF: keys are about all 16 elements of it")
    assert screen.session.rows.branch.path == "/legs/RF"
    assert "▼ HAA" in screen.text.partition("▼ RF")[2]
    await screen.enter(":goto /log/legs/LF/KFE", "z")
    assert "/legs/LF/KFE" in screen.session.rows.folded
    await screen.enter(":goto LF", "z")
    await screen.enter(":goto legs/lf/kfe/")
    await screen.until(lambda: screen.session.rows.branch.path == "/legs/LF/KFE")  # in one that was folded
    await screen.enter(":goto /KFE")
    assert screen.session.rows.branch is None, "no name space of the first level"
    await screen.enter(":goto /imu/temperature")
    assert screen.session.rows.row == screen.session.table.row("/log/imu/temperature")


async def test_what_was_in_frames_that_got_lost_is_asked_for_once_and_nothing_where_none_did(fake, opened, monkeypatch):
    asked, history = [], LiveSource.history

    async def noted(source, names, *span):
        asked.append(list(names))
        return await history(source, names, *span)

    monkeypatch.setattr(LiveSource, "history", noted)
    async with opened(fake.run(20), size=(160, 24)) as screen:

        async def frames():
            for _ in range(3):
                before_ns = screen.session.frame_time_ns
                fake.advance(0.2)
                await screen.until(lambda: screen.session.frame_time_ns > before_ns)  # noqa: B023
            await screen.settled()

        await screen.until(lambda: screen.session.columns.past_until_ns is not None)
        await frames()
        store, before = screen.session.columns, len(asked)
        assert store.names
        await frames()
        assert len(asked) == before
        store.live_since_ns = store.past_until_ns + 1
        await frames()
        assert asked[before:] == [list(store.names)]
        assert screen.session.columns is store
        assert not store.gapped


def torques(fake, first):
    legs = [info.name for info in fake.infos if info.name.endswith("torque")]
    return {"value": {name: 900.0 - 10 * ((place - first) % len(legs)) for place, name in enumerate(legs)}}


@pytest.mark.parametrize("marked", [0, 3])
async def test_rows_stand_still_while_a_prompt_about_them_is_open(fake, opened, monkeypatch, marked):
    """However long: the number that is typed lies over the row that it is of."""
    monkeypatch.setattr(table, "QUIET_S", 0.0)
    came = []
    survey_came = table.TableScreen._survey_came
    monkeypatch.setattr(
        table.TableScreen, "_survey_came", lambda self, now_s: (survey_came(self, now_s), came.append(now_s))
    )
    fake.run()
    fake.facts = torques(fake, 0)
    async with opened(fake, size=(160, 30)) as screen:
        shown, rows = screen.app.screen, screen.session.rows

        async def surveyed(first):
            fake.facts = torques(fake, first)
            count = len(came)
            await screen.until(lambda: len(came) > count + 1, "two surveys")

        await screen.do("sort", "v")
        await screen.until(lambda: rows.row == screen.session.table.row(TORQUE), "the largest")
        await screen.do(*["space"] * marked, "edit_size")
        before, edited = rows.shown.tolist(), screen.session.table.names[rows.row].removeprefix("/log/")
        await screen.shows(f"size of {f'{marked} marked elements' if marked else '/legs/LF/HAA/torque'}")
        await surveyed(2)
        assert rows.shown.tolist() == before
        over = screen.text.splitlines()[shown.query_one(CellEditor).region.y]
        assert f"/{edited} " in over
        await screen.press("escape", "b", shows="buffer of")
        before = rows.shown.tolist()
        await surveyed(4)
        assert rows.shown.tolist() == before
        await screen.press("escape")
        await screen.until(lambda: rows.shown.tolist() != before, "the order of now")


async def test_the_editor_goes_with_its_row_where_the_table_changes_or_the_terminal(screen, size=(160, 30)):
    await screen.enter("/torque", "j", "j")
    await screen.do("edit_size")
    editor, rows = screen.app.screen.query_one(CellEditor), screen.session.rows

    async def lies_over_it():
        await screen.until(
            lambda: (
                "LF/KFE/torque " in screen.text.splitlines()[editor.region.y]
                and editor.region.x == screen.app.screen.table.cell_region().x
            ),
            "the editor over its cell",
        )

    await lies_over_it()
    rows.set_filter("")  # as others do it to the table
    screen.app.context.table_changed()
    await lies_over_it()
    for size in (160, 16), (90, 30):
        await screen.pilot.resize_terminal(*size)
        await lies_over_it()


async def test_who_finds_nothing_frozen_is_told_of_what_never_changed(fake, opened):
    fake.run()
    fake.facts = {"std": {info.name: float(info.name != TORQUE) for info in fake.infos}}
    async with opened(fake) as screen:
        await screen.type("/frozen", shows="none stopped changing; std=0 has those that never changed")
        await screen.press("enter", "slash")
        await screen.type("std=0")
        await screen.until(lambda: screen.session.rows.shown.tolist() == [screen.session.table.row(TORQUE)], "it")


def test_noise_compares_what_has_different_units_by_the_median_of_siblings():
    known = np.array([1.0, 1.0, 9.0, 300.0, 290.0, 310.0, 0.0, np.nan])
    found = against_siblings(known, np.array([0, 0, 0, 1, 1, 1, 1, 2]))  # torques, energies which are all alike
    assert found[:3].tolist() == [1.0, 1.0, 9.0]
    assert np.allclose(found[3:7], [1.0, 290 / 300, 310 / 300, 0.0])
    assert against_siblings(np.array([1.0, 3.0]), np.zeros(2, np.intp)).tolist() == [0.5, 1.5], "of two the middle"
    assert np.isnan(found[7])
    assert np.nanargmax(found) == 2, "one torque is louder than its siblings"
    assert against_siblings(np.zeros(0), np.zeros(0, np.intp)).tolist() == []
    state, names = TableState(), ["/log/battery/power", "/log/legs/LF/power", "/log/legs/RF/power"]
    of = "W", "scalar", (), (Entry("", "<f8"),), ElementOptions()
    state.load(Table(1, [ElementInfo(each, *of) for each in names]))
    assert state.siblings[1] == state.siblings[2] != state.siblings[0], "the sum of all is no sibling of its parts"
    assert against_siblings(np.zeros(2), np.zeros(2, np.intp)).tolist() == [0.0, 0.0]
    assert against_siblings(np.array([5.0, 1.0]), np.arange(2)).tolist() == [1.0, 1.0], "no siblings"
