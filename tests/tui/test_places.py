"""Where samples stand among the time stamps of a recording: a distance apart, or listed."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import silo
from silo.core.recording import RecordedElement, Recording
from silo.core.structs import alike
from silo_tui.model.samples.places import Places
from silo_tui.model.samples.recorded import RecordingSource
from silo_tui.sessions.recorded import open_file
from tests.examples import examples
from tests.stand_ins.saved import element

STEP_NS = 10_000_000
STARTS = 1_790_000_000 * 10**9


def places(time_ns, first, step, count, own_ns=None):
    one = element("a", np.zeros(count), divider=step, first=first, own_ns=own_ns)
    return Places(Recording("robot", time_ns, len(time_ns), [one]), one, time_ns, 10)


@given(data=st.data(), ticks=st.integers(1, 60), first=st.integers(0, 9), step=st.integers(1, 7))
@settings(max_examples=examples(100))
def test_both_ways_to_say_where_samples_stand_say_the_same(data, ticks, first, step):
    time_ns = np.cumsum(np.array(data.draw(st.lists(st.integers(1, 5), min_size=ticks, max_size=ticks)), np.int64))
    count = len(range(first, ticks, step))
    own = time_ns[first::step]
    apart, listed = places(time_ns, first, step, count), places(time_ns, 0, 1, count, own)
    numbers = np.arange(-1, ticks + 2)
    truth = [int((np.arange(first, ticks, step) < number).sum()) for number in numbers]
    for one in (apart, listed):
        assert one.count == count
        assert one.from_stamp(numbers).tolist() == truth
        assert [one.at(sample) for sample in range(count)] == list(range(first, ticks, step))
        assert one.stamps(0, count).tolist() == own.tolist()
        for at_ns in range(int(time_ns[0]) - 1, int(time_ns[-1]) + 2):
            assert one.held_at(at_ns) == int((own <= at_ns).sum()) - 1


def test_samples_hold_to_the_next_one_and_the_last_as_long_as_one_more_would_have_taken():
    time_ns = np.arange(100, dtype=np.int64) * 10
    slow = places(time_ns, 0, 10, 5)
    assert slow.held_until_ns(np.array([0, 4])).tolist() == [490, 490]
    assert slow.period_ns == 100
    of_others = places(time_ns, 0, 1, 6, np.array([0, 20, 40, 600, 620, 900]))
    assert of_others.period_ns == 20
    assert of_others.held_until_ns(np.array([2, 5])).tolist() == [920, 920]
    assert [of_others.held_at(at_ns) for at_ns in (59, 60, 599, 990)] == [2, 2, 2, 5]


def cut_run(folder):
    """A run that was cut three times: another divider, and a signal off for a while. Its ticks count from 1."""
    x, y, now = np.zeros(()), np.zeros(3), [STARTS]
    log = silo.Logger("arm", frequency=100, max_time=10, folder=folder, script=folder / "no.yaml", clock=lambda: now[0])
    log.add(x, "x")
    log.add(y, "y", divider=3)
    log.start()

    def ticks(count):
        for _ in range(count):
            x[...] += 1
            y[...] = x * np.arange(3)
            log.collect()
            now[0] += STEP_NS

    ticks(50)
    log.set("y", divider=5, cut=True)
    ticks(50)
    log.set("x", enabled=False, cut=True)
    ticks(30)
    log.set("x", enabled=True, cut=True)
    ticks(20)
    log.stop()
    log.save()
    log.close()


def test_all_parts_of_a_run_that_was_cut_are_on_the_screen(tmp_path):
    cut_run(tmp_path)
    session = open_file(tmp_path)
    of, held_y = session.source, 0
    assert "4 parts  1.49 s  150 ticks" in "".join(words for _, words, _ in session.facts_words(120, wide=True))
    for tick in range(150):
        found = of.readings(["/log/x", "/log/y"], STARTS + tick * STEP_NS)
        assert np.array_equal(found["/log/x"].newest, [tick + 1 if not 100 <= tick < 130 else np.nan], equal_nan=True)
        held_y = tick if (tick % 3 == 0 if tick < 50 else (tick - 50) % 5 == 0 if tick < 100 else False) else held_y
        if tick < 100:
            assert found["/log/y"].newest.tolist() == [0.0, held_y + 1.0, 2.0 * (held_y + 1)]
    shown = of.columns(["/log/x"], of.begin_ns, of.end_ns, 2 * STEP_NS)
    truth = np.array([float(n) if not 101 <= n <= 130 else np.nan for n in range(1, 151)]).reshape(-1, 2)
    assert np.array_equal(shown.low[0], truth[:, 0], equal_nan=True)
    assert np.array_equal(shown.high[0], truth[:, 1], equal_nan=True)
    facts = session._facts
    assert facts.of("/log/x", ["count", "max", "changed"], of.end_ns) == {"count": 120, "max": 150, "changed": 0}
    assert np.isnan(facts.of("/log/x", ["share"], of.end_ns)["share"])  # of one rate nobody can say


def test_nothing_is_shown_of_a_part_that_is_missing(tmp_path):
    cut_run(tmp_path)
    min(tmp_path.glob("*_part2.silo")).unlink()
    session = open_file(tmp_path)
    of = session.source
    shown = of.columns(["/log/x", "/log/y"], of.begin_ns, of.end_ns, STEP_NS)
    ticks = np.arange(150)
    there = (ticks < 50) | (ticks >= 130)
    assert np.array_equal(shown.low[0], np.where(there, ticks + 1.0, np.nan), equal_nan=True)
    assert np.isnan(of.readings(["/log/y"], STARTS + 70 * STEP_NS)["/log/y"].newest).all()


def test_a_topic_without_a_message_is_shown_as_empty():
    none = np.zeros(0, np.int64)
    time_ns = STARTS + np.arange(50) * STEP_NS
    elements = [
        alike(RecordedElement, element("x", np.arange(50.0)), own_ns=time_ns),
        alike(RecordedElement, element("none", np.zeros(0)), own_ns=none),
    ]
    source = RecordingSource(Recording("bag", time_ns, 0, elements), ["x", "none"])
    for column_ns in (STEP_NS // 10, STEP_NS * 10):
        assert np.isnan(source.columns(["none"], source.begin_ns, source.end_ns, column_ns).low).all()
