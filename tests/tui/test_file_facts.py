"""What filters, orders and columns of a file's table show: reckoned from its samples."""

from dataclasses import replace

import numpy as np
import pytest

from silo.analysis.reports import report
from silo.core.recording import Recording
from silo.files.silo.writer import write_silo
from silo.live.quantities import FROZEN, LOST, NOT_FINITE, SLOW
from silo_tui.model.samples.places import places_of
from silo_tui.model.table import file_facts
from silo_tui.model.table.file_facts import FileFacts
from tests.stand_ins.saved import element

STEP_NS = 10_000_000
TICKS = 1000
TIMES = np.arange(TICKS, dtype=np.int64) * STEP_NS + 10**18


def recording(*elements, frequency_hz=100.0):
    return Recording("robot", TIMES, TICKS, elements, frequency_hz=frequency_hz)


def facts_of(*elements, **changes):
    found = recording(*elements, **changes)
    return FileFacts(found, [one.name for one in elements], places_of(found, found.time_ns, 0))


def told(facts, name, quantity, at_ns=int(TIMES[-1])):
    return facts.of(f"/log/{name}", [quantity], at_ns)[quantity]


RAMP = np.arange(TICKS, dtype="f8")


@pytest.mark.parametrize("block", [7, 1 << 16])
def test_statistics_are_of_all_samples_but_nan_however_they_are_read(monkeypatch, block):
    monkeypatch.setattr(file_facts, "BLOCK", block)
    values = RAMP + 1e9
    values[500] = np.nan
    good = values[np.isfinite(values)]
    facts = facts_of(element("ramp", values))
    assert told(facts, "ramp", "min") == good.min()
    assert told(facts, "ramp", "max") == good.max()
    assert told(facts, "ramp", "mean") == pytest.approx(good.mean(), abs=1e-6)
    assert told(facts, "ramp", "std") == pytest.approx(good.std(), rel=1e-9)
    facts = facts_of(element("ramp", np.where(RAMP == 501, np.inf, values)))
    assert [told(facts, "ramp", quantity) for quantity in ("min", "max", "mean")] == [1e9, np.inf, np.inf]


def test_statistics_that_no_number_can_say_are_unknown_and_not_zero():
    assert np.isnan(told(facts_of(element("huge", RAMP * 1e200)), "huge", "std"))
    assert np.isnan(told(facts_of(element("nan", RAMP * np.nan)), "nan", "mean"))
    assert np.isnan(told(facts_of(element("word", np.array([b"a"] * TICKS))), "word", "max"))


def test_a_vector_is_told_by_its_norm_and_each_of_its_entries():
    facts = facts_of(element("force", [3 * RAMP, -4 * RAMP], "Nm"))
    assert told(facts, "force", "value") == 5 * (TICKS - 1)
    assert told(facts, "force", "max") == 5 * (TICKS - 1)
    assert told(facts, "force_1", "min") == -4 * (TICKS - 1)


def test_a_value_is_that_of_the_moment():
    facts = facts_of(element("late", RAMP[:100], divider=4, first=500))
    assert np.isnan(told(facts, "late", "value", int(TIMES[499])))
    assert told(facts, "late", "value", int(TIMES[503])) == 0
    assert told(facts, "late", "value", int(TIMES[504])) == 1
    assert told(facts, "late", "value") == 99


@pytest.mark.parametrize("block", [3, 1 << 16])
def test_the_last_change_is_found_up_to_the_moment_however_it_is_read(monkeypatch, block):
    monkeypatch.setattr(file_facts, "BLOCK", block)
    steps = np.repeat([1, 2, 3], [100, 200, 700])
    facts = facts_of(element("mode", steps), element("still", np.ones(TICKS)))
    assert told(facts, "mode", "changed") == pytest.approx((TICKS - 1 - 300) * 0.01)
    assert told(facts, "mode", "changed", int(TIMES[299])) == pytest.approx(1.99)
    assert told(facts, "still", "changed") == pytest.approx(9.99)
    assert [told(facts, name, "change_seen") for name in ("mode", "still")] == [1, 0], "of the first sample none is"


def test_a_vector_changed_when_any_of_its_entries_did():
    angle = np.linspace(0, 6, TICKS)
    facts = facts_of(element("turning", [np.cos(angle), np.sin(angle)]))  # its norm is 1 all the time
    assert told(facts, "turning", "changed") == 0


def test_rate_share_and_jitter_are_of_the_samples_of_an_element():
    facts = facts_of(element("slow", RAMP[:250], divider=4), frequency_hz=200.0)
    assert told(facts, "slow", "rate") == pytest.approx(25.0)
    assert told(facts, "slow", "share") == pytest.approx(0.5)
    assert told(facts, "slow", "jitter") == pytest.approx(0.0)


def test_what_a_file_has_no_samples_of_is_no_step_of_their_rate():
    """Of one that was saved while it was cut buffers held the newest alone; the program told how long each holds."""
    own = TIMES[np.r_[0:100, 900:1000]]
    cut = element("cut", RAMP[:200], own_ns=own, holds=((1, 200),))
    assert told(facts_of(cut), "cut", "rate") == pytest.approx(100.0)
    assert told(facts_of(cut), "cut", "jitter") == pytest.approx(0.0)
    assert report(recording(cut), "", 0).elements[0].rate_hz == pytest.approx(100.0)
    seldom = element("seldom", RAMP[:200], own_ns=own)  # nothing says that any is missing
    assert told(facts_of(seldom), "seldom", "rate") == pytest.approx(199 / 9.99)


def test_signs_say_what_is_the_matter():
    ends_badly = RAMP.copy()
    ends_badly[-1] = np.nan
    frozen = np.where(RAMP < 500, RAMP, 500.0)
    facts = facts_of(
        element("nan", ends_badly), element("frozen", frozen), element("lost", RAMP, lost=3), element("fine", RAMP),
        element("state", np.zeros(TICKS, "i4"), labels={0: "stand"}), element("still", np.ones(TICKS)),
        element("peak", np.floor(np.minimum(RAMP, 500.0) / 100)),
    )  # fmt: skip
    signs = {name: told(facts, name, "signs") for name in ("nan", "frozen", "lost", "fine", "state", "still", "peak")}
    assert signs == {"nan": NOT_FINITE, "frozen": FROZEN, "lost": LOST, "fine": 0, "state": 0, "still": 0, "peak": 0}
    assert told(facts, "frozen", "signs", int(TIMES[300])) == 0
    slow = facts_of(element("slow", RAMP), frequency_hz=200.0)
    assert told(slow, "slow", "signs") == SLOW


def test_a_survey_goes_on_where_its_time_was_over():
    facts = facts_of(*(element(f"s{at}", RAMP + at) for at in range(5)))
    out = {"max": np.full(5, np.nan)}
    done, calls = 0, 0
    while done < 5:
        done = facts.survey(["max"], int(TIMES[-1]), out, done, 0.0)
        calls += 1
    assert calls == 5
    assert out["max"].tolist() == [999.0, 1000.0, 1001.0, 1002.0, 1003.0]


# ------------------------------------------------------------------------------------------------------ on the screen


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "robot_00007.silo"
    spike = np.sin(RAMP / 20)
    spike[400] = 90.0
    elements = (
        element("a/low", RAMP * 0 - 70.0), element("b/ramp", RAMP / 10), element("c/spike", spike),
        element("d/vector", [RAMP * 0.03, RAMP * 0.04]),
    )  # fmt: skip
    write_silo(recording(*elements), found)
    return found


@pytest.fixture
def screen(on_file, path):
    return on_file(path)


def order(screen):
    rows = screen.session.rows
    return [screen.session.table.names[row].rpartition("/")[2] for row in rows.shown]


async def test_a_file_is_ordered_by_what_its_samples_say(screen):
    for letter, found in (
        ("v", "ramp vector spike low"), ("a", "ramp low vector spike"), ("m", "ramp spike vector low"),
        ("i", "low spike ramp vector"), ("t", "ramp vector spike low"), ("c", "ramp spike vector low"),
    ):  # fmt: skip
        await screen.press("j", "o", letter)
        await screen.until(lambda found=found: " ".join(order(screen)) == found, f"by {letter}: {found}")
        assert screen.session.rows.position == 0, letter


async def test_at_80_columns_an_order_by_value_shows_the_values(screen):
    await screen.press("o", "a")
    await screen.until(lambda: screen.session.table.facts.time_ns)
    assert order(screen)[:2] == ["ramp", "low"]
    await screen.shows("-70")
    await screen.shows("99.9")


async def test_a_measured_term_lets_only_pass_what_the_file_has(screen):
    await screen.enter("/value>60")
    await screen.until(lambda: order(screen) == ["ramp"])
    await screen.shows("1 of 4")


async def test_every_measured_term_is_answered_from_the_file(screen):
    for words, found in (
        ("changed>5s", "low"), ("changed<1s", "ramp spike vector"), ("max>80", "ramp spike"), ("rate<95%", ""),
        ("rate>99Hz mean<0", "low"), ("frozen", ""), ("-alarm std<10", "low spike"), ("fill>1%", ""),
    ):  # fmt: skip
        await screen.enter(f"/{words}")
        await screen.until(lambda found=found: " ".join(order(screen)) == found, words)
        head = screen.text.splitlines()[1]
        assert " at 9.99 s" in head  # the column of values
        assert any(each in head for each in ("max", "rate", "std")) == words.startswith(("max", "rate", "-alarm"))
        await screen.press("escape")
        assert len(order(screen)) == 4
        assert " at 9.99 s" not in screen.text.splitlines()[1]


async def test_terms_follow_the_cursor_of_the_plots(screen):
    await screen.enter("/|value|>60")
    await screen.until(lambda: order(screen) == ["low", "ramp"])
    screen.session.time_ns = int(TIMES[400])
    screen.app.screen.request_view()
    await screen.until(lambda: order(screen) == ["low", "spike"])


async def test_statistics_of_a_file_are_columns(screen):
    await screen.do("columns")
    await screen.until(lambda: "/log/c/spike" in screen.session.table.facts.details)
    await screen.shows("mean")
    line = next(line for line in screen.text.splitlines() if "spike" in line).split()
    assert "90.00" in line
    await screen.do("columns", shows="jitter")
    await screen.do("columns", shows="samples")


def test_values_that_a_bag_of_others_lacks_are_in_no_statistic():
    lacking = element("c", np.arange(TICKS))
    values = np.ma.masked_array(np.arange(TICKS), np.arange(TICKS) >= 10)
    entry = replace(lacking.entries[0], values=values)
    facts = facts_of(replace(lacking, entries=(entry,)))
    assert [told(facts, "c", quantity) for quantity in ("max", "mean", "bad")] == [9, 4.5, TICKS - 10]


async def test_reading_stops_after_a_slice_when_something_else_is_asked_for(path, on_file, monkeypatch):
    monkeypatch.setattr("silo_tui.sessions.recorded.SLICE_S", 0.0)
    async with on_file(path) as screen:
        await screen.press("o", "m")
        await screen.press("o", "v")
        await screen.until(lambda: "value" in screen.session.table.facts.quantities)
        assert order(screen)[0] == "ramp"
