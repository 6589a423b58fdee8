"""Derived signals read from a segment in any pieces are what the whole recording gives."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import silo
from silo.analysis.log import Log
from silo.core.conditions import Derived
from silo.core.elements import BufferType
from silo.journal.derived_rows import DerivedReader, derived_plan
from silo.segment.reader import SegmentReader
from tests.examples import examples

TICKS = 300
EXPRESSIONS = (
    "2 * a", "a - c", "prev(b)", "diff(a) + rate(c)", "mean(a, 40ms)", "max(diff(b), 25ms) + d", "std(c, 100ms)",
    "b - c", "a > 10 and prev(d) < 3", "v * a", "norm(v)", "min(v_x, 30ms)", "prev(prev(c))", "isnan(d)",
    "e + prev(f)",
)  # fmt: skip


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """A logger in which what is derived is known: in buffers that keep everything, and in ones that forget."""
    folder = tmp_path_factory.mktemp("derived")
    random = np.random.default_rng(5)
    now = [10**18]
    log = silo.Logger("d", frequency=1000, max_time=0, folder=folder, script=folder / "s.yaml", clock=lambda: now[0])
    values = {
        name: log.array(name, shape, divider=divider, buffer=BufferType.GROWING, size=100)
        for name, shape, divider in (("a", (), 1), ("b", (), 2), ("c", (), 3), ("d", (), 5), ("v", (3,), 1))
    }
    e, f = (log.array(name, divider=divider, buffer=BufferType.GROWING) for name, divider in (("e", 4), ("f", 6)))
    short = log.array("short", buffer=BufferType.LOOPING, size=50)
    full = log.array("full", buffer=BufferType.FIXED, size=70)
    log.start()
    for tick in range(TICKS):
        for array in values.values():
            array[...] = random.normal(size=array.shape) * 10
        short[...] = full[...] = e[...] = f[...] = tick
        log.collect()
        now[0] += int(10**6 * random.uniform(0.2, 2))  # the loop runs faster and slower than it should
    yield log
    log.close()


def reader_of(log, *expressions):
    path = log._present.path
    derived = tuple(Derived(f"/log/x{at}", text) for at, text in enumerate(expressions))
    plan = derived_plan(SegmentReader(path).schema, log.elements, derived)
    return DerivedReader(path, None, plan), [one for one in plan.schema.elements if one.info.expression]


@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(text=st.sampled_from(EXPRESSIONS), data=st.data())
def test_pieces_of_any_order_and_size_are_parts_of_the_whole(logged, text, data):
    reader, (element,) = reader_of(logged, text)
    truth = Log(logged.snapshot()).eval(text)
    divider = element.info.options.divider
    ticks = np.arange(0, TICKS, divider)
    held = np.searchsorted(truth.time_ns, logged.snapshot().time_ns[ticks], "right") - 1
    whole = truth.values.reshape(len(truth.values), -1).astype(float)
    for _ in range(data.draw(st.integers(1, 6))):
        since, count = data.draw(st.integers(0, len(ticks) - 1)), data.draw(st.integers(1, 60))
        rows = reader.rows(element.ring, since, count)
        assert (rows.first, len(rows)) == (since, min(count, len(ticks) - since))
        assert rows.ticks.tolist() == ticks[since : since + count].tolist()
        assert rows.time_ns.tolist() == logged.snapshot().time_ns[rows.ticks].tolist()
        for at, entry in enumerate(element.entries):
            found, places = rows.column(entry), held[since : since + count]
            known = places >= 0  # before them nothing could be told, and no sample is there
            np.testing.assert_allclose(found[known], whole[places[known], at], rtol=1e-9, atol=1e-9)


def test_what_is_overwritten_is_not_there(logged):
    reader, (element,) = reader_of(logged, "short + a")
    rows = reader.rows(element.ring, 0)
    plain = SegmentReader(logged._present.path)
    elements = {one.info.name: one for one in plain.schema.elements}
    assert rows.first == plain.rows(elements["/log/short"].ring, 0).first > 0
    assert rows.first + len(rows) == TICKS
    short = rows.ticks.astype(float)
    whole = plain.rows(elements["/log/a"].ring, 0).part(rows.first, TICKS)
    kept = whole.column(elements["/log/a"].entries[0])
    assert rows.column(element.entries[0]).tolist() == (short + kept).tolist()


def test_it_ends_where_a_buffer_that_is_full_ends(logged):
    reader, (element,) = reader_of(logged, "full + a")
    assert reader.head(element.ring) == 70
    assert reader.schema.rings[element.ring].buffer_type is BufferType.FIXED


def test_stamps_alone_are_read_without_computing(logged):
    for text, divider in (("b - c", 1), ("b + b", 2), ("e - f", 2)):
        reader, (element,) = reader_of(logged, text)
        rows = reader.rows(element.ring, 17, 4, np.arange(2))
        assert rows.ticks.tolist() == [divider * row for row in (17, 18, 19, 20)]
        assert (rows.first, rows.words.shape) == (17, (4, 2))


def test_what_needs_an_element_that_is_off_has_no_ring(tmp_path):
    with silo.Logger("other", folder=tmp_path, script=tmp_path / "s.yaml") as log:
        log.array("a")
        log.array("b", enabled=False)
        log.start()
        assert reader_of(log, "a + b", "a > 1 or b > 2", "nothing + 1")[1][0].info.name == "/log/x1"
