"""Expressions over batches of rows: the same as row by row, whatever the cut, whatever is missing."""

import math
from dataclasses import replace
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.conditions.state_file import array_of, array_parts
from silo.core.arrays.values import as_exact
from silo.core.elements import Entry
from silo.expressions.binding import OFF, Catalogue, Known, bind
from silo.expressions.evaluation import Evaluator, EvaluatorMemory, SourceRows
from tests.examples import examples
from tests.judging.reference import Reference, Stream

DIVIDERS = {0: 1, 1: 2, 2: 5}
LABELS = {0: "STANCE", 1: "SWING", 2: "TROT"}


def known(name, source, *suffixes, dtype="<f8", labels=None, unit="-"):
    entries = tuple(Entry(suffix, dtype, labels) for suffix in suffixes or ("",))
    return Known(f"/log/{name}", entries, unit, source, DIVIDERS.get(source, 1))


ELEMENTS = [
    known("a", 0), known("b", 1), known("c", 2), known("v", 0, "_0", "_1", "_2"), known("w", 1, "_0", "_1", "_2"),
    known("mode", 2, dtype="<i4", labels=LABELS), known("gone", OFF), known("slow/x", 2), known("slow/y", 1),
]  # fmt: skip
CATALOGUE = Catalogue(ELEMENTS)


def _type_of(stream, key):
    """Columns without a row are of the type of those with some, as they are of a run."""
    return np.int64 if stream.rows and type(stream.rows[0][2][key]) is int else np.float64


def rows_of(stream, source, low=-math.inf, high=math.inf):
    """The rows of a stream with ticks from `low` to below `high`."""
    rows = [row for row in stream.rows if low <= row[0] < high]
    keys = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
    return SourceRows(
        np.array([row[0] for row in rows], np.int64),
        np.array([row[1] for row in rows], np.int64),
        {key: as_exact(np.array([row[2][key] for row in rows], _type_of(stream, key))) for key in keys},
    )


def evaluated(bound, streams, cuts=(), *, handed_over=False):
    """Ticks and results of all batches between the cuts, put together; of another evaluator each, if handed over."""
    evaluator = Evaluator(bound)
    edges = [-math.inf, *cuts, math.inf]
    found = []
    for low, high in pairwise(edges):
        rows = {source: rows_of(stream, source, low, high) for source, stream in streams.items()}
        found.append(evaluator.feed(rows))
        if handed_over:
            kept = msgspec.msgpack.encode(evaluator.memory(), enc_hook=array_parts)
            evaluator = Evaluator(bound)
            evaluator.recall(msgspec.msgpack.decode(kept, type=EvaluatorMemory, dec_hook=array_of))
    return (
        np.concatenate([one.ticks for one in found]),
        np.concatenate([one.numbers() for one in found]),
    )


# -------------------------------------------------------------------------------------------------- any expression

scalars = st.sampled_from(["a", "b", "c", "v_1", "w_2", "slow/x", "gone"])
numbers = st.sampled_from(["0", "1", "-2", "0.5", "3"])
vectors = st.sampled_from(["v", "w", "slow/*"])


def _scalar(deeper):
    inner = deeper["scalar"]
    return st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*/"), inner),
        st.builds("{}({})".format, st.sampled_from(["abs", "prev", "diff", "rate", "-"]), inner),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner),
        st.builds("{}({}, {}ms)".format, st.sampled_from(["min", "max", "mean"]), inner, st.sampled_from([1, 3, 7])),
        st.builds("{}({})".format, st.sampled_from(["max", "min", "sum", "prev(3) + norm"][:3]), deeper["vector"]),
        st.builds("mean({}, 5ms)".format, deeper["truth"]),
    )


def _vector(deeper):
    inner = deeper["vector"]
    return st.one_of(
        st.builds("({} {} {})".format, vectors.filter(lambda v: v != "slow/*"), st.sampled_from("+-*"),
                  st.sampled_from(["v", "w", "a", "b", "2"])),
        st.builds("{}({})".format, st.sampled_from(["abs", "prev", "diff"]), inner),
        st.builds("{}({}, {}ms)".format, st.sampled_from(["min", "mean"]), inner, st.sampled_from([2, 6])),
    )  # fmt: skip


def _truth(deeper):
    scalar, truth = deeper["scalar"], deeper["truth"]
    compare = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    return st.one_of(
        st.builds("({} {} {})".format, scalar, compare, scalar),
        st.builds("({} < {} <= {})".format, scalar, scalar, scalar),
        st.builds("({} {} {})".format, truth, st.sampled_from(["and", "or"]), truth),
        st.builds("(not {})".format, truth),
        st.builds("{}({} {} {})".format, st.sampled_from(["any", "all"]), deeper["vector"], compare, scalar),
        st.builds("(mode == {})".format, st.sampled_from([*LABELS.values()])),
        st.builds("isnan({})".format, scalar),
        st.builds("prev({})".format, truth),
    )


def _level(depth):
    if depth == 0:
        return {"scalar": st.one_of(scalars, numbers), "vector": vectors, "truth": st.just("a > b")}
    below = _level(depth - 1)
    return {
        "scalar": st.one_of(below["scalar"], _scalar(below)),
        "vector": st.one_of(below["vector"], _vector(below)),
        "truth": st.one_of(_truth(below)),
    }


_top = _level(3)
expressions = st.one_of(_top["truth"], _top["scalar"])
values = st.one_of(st.integers(-3, 3).map(float), st.sampled_from([math.nan, 0.5]))


@st.composite
def recordings(draw):
    """Streams of all sources: some begin late, some rows are missing, the clock may jump."""
    ticks = draw(st.integers(1, 24))
    jump_at, jump = draw(st.integers(0, 24)), draw(st.sampled_from([0, 0, -4, 9]))
    streams = {}
    for source, divider in DIVIDERS.items():
        lost = draw(st.sets(st.integers(0, ticks // divider), max_size=3))
        rows, begins = [], draw(st.sampled_from([0, 0, 0, 4, 11]))
        for tick in range(0, ticks, divider):
            row = {
                (at, n): draw(values) for at, e in enumerate(ELEMENTS) if e.source == source
                for n in range(len(e.entries))
            }  # fmt: skip
            if tick // divider not in lost and tick >= begins:
                rows.append((tick, 10**9 + (tick + (jump if tick >= jump_at else 0)) * 10**6, row))
        streams[source] = Stream(divider, rows)
    cuts = draw(st.lists(st.integers(0, ticks), max_size=5).map(sorted))
    return streams, cuts


def same(found, wanted):
    if isinstance(wanted, bool) or wanted is None:
        wanted = math.nan if wanted is None else float(wanted)
    return (math.isnan(found) and math.isnan(wanted)) or found == wanted or math.isclose(found, wanted, rel_tol=1e-9)


@pytest.mark.parametrize(
    ("text", "value"),
    [("a < 0 / 0", None), ("0 / 0 == a", None), ("a < 1 / 0", True), ("not (a < 0 / 0)", None),
     ("a < 1 or a < 0 / 0", True), ("a > 1 and a < 0 / 0", False)],
)  # fmt: skip
def test_of_a_constant_that_is_no_number_nobody_can_tell(text, value):
    streams = {}
    for source, divider in DIVIDERS.items():
        places = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
        streams[source] = Stream(divider, [(0, 10**9, dict.fromkeys(places, 0.0))])
    _, found = evaluated(bind(text, CATALOGUE), streams, [])
    assert same(float(found[0]), value)


@settings(max_examples=examples(150))
@given(expressions, recordings())
def test_any_cut_into_batches_gives_what_a_judge_row_by_row_gives(text, recorded):
    streams, cuts = recorded
    try:
        bound = bind(text, CATALOGUE)
    except ValueError:
        return  # a constant alone, or a scalar where a vector belongs
    ticks, found = evaluated(bound, streams, cuts)
    wanted = Reference(bound, streams).judged()
    assert ticks.tolist() == [tick for tick, _ in wanted]
    for at, (tick, value) in enumerate(wanted):
        assert same(float(found[at]), value), (text, tick, found[at], value)


@settings(max_examples=examples(25))
@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 300), max_size=8).map(sorted))
def test_roundings_are_the_same_for_any_cut(seed, cuts):
    rng = np.random.default_rng(seed)
    streams = {}
    for source, divider in DIVIDERS.items():
        keys = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
        streams[source] = Stream(divider, [
            (tick, tick * 10**6, {key: float(rng.normal() * 10.0 ** rng.integers(-6, 7)) for key in keys})
            for tick in range(0, 300, divider) if rng.random() > 0.01
        ])  # fmt: skip
    for text in (
        "mean(a, 37ms) - mean(c, 0.1s)", "std(a * b, 23ms)", "sum(v * w) / norm(v)", "mean(rate(c), 40ms)",
        "std(a, 90ms) - std(v_1, 70ms)", "mean(a, 0.2s) * min(a, 80ms)",
    ):  # fmt: skip
        bound = bind(text, CATALOGUE)
        (ticks, whole), (cut_ticks, cut) = evaluated(bound, streams), evaluated(bound, streams, cuts)
        assert (ticks == cut_ticks).all()
        assert whole.tobytes() == cut.tobytes(), text


STAMP = 1_790_000_000_000_000_000  # of ns: a float64 tells no two within 256 of each other apart
OF_INTEGERS = (
    "a - b", "a - b - 3 + c - a", "-a + b", "2 * a - b - c", "a == b", "a != c", "a < b", "b >= c", "c - a > 0.5",
    "diff(a)", "diff(c)", "rate(b)", "diff(a - b)", "prev(a - c)", "w_0 - c", "abs(a - b) <= c - b",
    "max(a - b, 3ms)", "mean(c - a, 7ms)", "any(v == w)", "sum(v - w)", "v_1 - w_2 == a - b", "a - gone", "a * 0.5 - c",
    "mode - c + a", "(a - b) / 2 + (b - a) * (c - a)", "w_1 * (a - b) - v_2", "a - b + slow/y", "c - slow/x",
    "slow/x < b - a", "mode + slow/y", "slow/y < mode + 1", "mode * slow/x - slow/y", "diff(mode + slow/y)",
    "slow/y - (a - b) <= mode",
    "abs(a) - b", "max(a, b) - c", "min(v) == b", "sum(v) - 2 * b - a", "max(w) - min(v) + a", "a % b % 1000 - a % 7",
    "a % (b - c)", "max(a - b, w_1) + prev(c)", "abs(diff(a)) % 3",
    "a - prev(a)", "prev(a) - c", "c - prev(b)", "prev(a) == b", "prev(prev(a)) - a", "any(prev(v) == w)",
    "diff(c) - prev(diff(c))",
    "prev(a - b) * 2 - prev(c) + a", "prev(slow/x) < prev(b) - a", "prev(gone) - a", "prev(mode) + slow/y",
    "rate(a) * 2", "rate(a) > 5", "-rate(b) + c - a", "rate(mode) + slow/y", "mode + prev(slow/y)",
    "mode + diff(slow/x)", "mode + mean(slow/y, 4ms)", "mode + max(slow/x, 4ms)", "sum(prev(v) * 2 - a)",
    "sum(prev(w) * 2) + a", "any(prev(v) > c)", "prev(mode) * 2 - mode", "mode - prev(slow/y) * 2",
    "mean(mode, 6ms) + slow/y + mode",
    "a % 7", "a % 256 - prev(a) % 256", "(a - b) % 3", "a % (b - c)", "sum(v % 100)", "-a % 1000",
    "a % (c - c)", "slow/x % 2",
    f"a - {STAMP}", f"a == {STAMP + 1}", f"{STAMP - 3} - a <= b - {STAMP}", f"-{STAMP} + c", f"prev(a) >= {STAMP + 2}",
    f"a % {STAMP}", f"({STAMP + 5} - v_1) * 2",
)  # fmt: skip

OF_FLOATS = ("/log/slow/x", "/log/slow/y")


@settings(max_examples=examples(150))
@given(st.sampled_from(OF_INTEGERS), recordings(), st.booleans())
def test_integers_that_no_float_holds_are_judged_to_the_last_digit(text, recorded, handed_over):
    streams, cuts = recorded
    for stream in streams.values():
        for _, _, row in stream.rows:
            for key, value in row.items():
                name = ELEMENTS[key[0]].name
                if name not in OF_FLOATS:
                    row[key] = (1 if name == "/log/mode" else STAMP) + (0 if math.isnan(value) else int(2 * value))
    bound = bind(text, CATALOGUE)
    ticks, found = evaluated(bound, streams, cuts, handed_over=handed_over)
    wanted = Reference(bound, streams, whole=True).judged()
    assert ticks.tolist() == [tick for tick, _ in wanted]
    for at, (tick, value) in enumerate(wanted):
        assert same(float(found[at]), value), (text, tick, found[at], value)


@pytest.mark.parametrize("text", ["a + c", "a - c > 0.2", "c * a", "diff(a + c)", "a < c", "v_0 + c - a"])
def test_a_float_that_holds_over_a_batch_without_a_sample_stays_what_it_is(text):
    keys = {
        source: [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
        for source in (0, 2)
    }
    streams = {
        0: Stream(1, [(tick, tick * 10**6, dict.fromkeys(keys[0], tick)) for tick in range(10)]),
        2: Stream(5, [(tick, tick * 10**6, dict.fromkeys(keys[2], tick + 0.5)) for tick in (0, 5)]),
    }
    bound = bind(text, CATALOGUE)
    wanted = [value for _, value in Reference(bound, streams).judged()]
    for cuts in ([], [3], [1, 2, 6, 8]):
        found = evaluated(bound, streams, cuts)[1]
        assert all(map(same, found.tolist(), wanted)), cuts


# -------------------------------------------------------------------------------------------------- single facts


def stream_of(values_at, source, key, divider=None):
    keys = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
    rows = [(tick, tick * 10**6, {**dict.fromkeys(keys, 0.0), key: value}) for tick, value in values_at]
    return Stream(divider or DIVIDERS[source], rows)


def test_a_window_takes_the_samples_of_the_last_time_without_the_one_that_is_just_as_old():
    streams = {0: stream_of(enumerate([1.0, 2.0, 4.0, 8.0]), 0, (0, 0))}
    assert evaluated(bind("mean(a, 2ms)", CATALOGUE), streams)[1].tolist() == [1.0, 1.5, 3.0, 6.0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("any(a > 3, 2ms)", [0, 0, 1, 1, 0]),
        ("all(a, 2ms)", [0, 0, 1, 1, 0]),
        ("any(a, 2ms)", [0, 1, 1, 1, 0]),
        ("not any(a > 3, 2ms)", [1, 1, 0, 0, 1]),
        ("sum(a, 2ms)", [0, 2, 6, 4, 0]),
        ("any(a > 3, a < 0)", [0, 0, 1, math.nan, 0]),
    ],
)
def test_truths_and_sums_of_a_time(text, expected):
    streams = {0: stream_of(enumerate([0.0, 2.0, 4.0, math.nan, 0.0]), 0, (0, 0))}
    assert evaluated(bind(text, CATALOGUE), streams)[1] == pytest.approx(expected, nan_ok=True)


def test_deviation_of_large_numbers_loses_no_digits():
    rng = np.random.default_rng(1)
    noise = rng.normal(size=500)
    streams = {0: stream_of(enumerate(1e9 + noise), 0, (0, 0))}
    found = evaluated(bind("std(a, 100ms)", CATALOGUE), streams)[1][-1]
    assert found == pytest.approx(np.std((1e9 + noise)[-100:]), rel=1e-9)


def test_an_infinity_leaves_a_mean_when_it_leaves_the_window():
    streams = {0: stream_of(enumerate([1.0, math.inf, 3.0, 5.0]), 0, (0, 0))}
    assert evaluated(bind("mean(a, 2ms)", CATALOGUE), streams)[1].tolist() == [1.0, math.inf, math.inf, 4.0]


@pytest.mark.parametrize(
    "text", ["diff(a)", "prev(b) - a", "rate(c)", "mean(a, 37ms)", "max(b - c, 90ms)", "sum(diff(v * w))"]
)
@pytest.mark.parametrize("lost", [False, True])
def test_over_a_cut_steps_and_windows_go_on_unless_a_sample_is_missing(text, lost):
    rng = np.random.default_rng(5)
    parts, whole, begin = [], {source: [] for source in DIVIDERS}, 0
    for length, dividers in ((83, DIVIDERS), (41, {0: 2, 1: 1, 2: 7}), (1, {0: 2, 1: 3, 2: 7}), (60, DIVIDERS)):
        streams = {}
        for source, divider in dividers.items():
            keys = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
            ticks = range(0, length - 10 * (lost and begin == 83), divider)
            rows = [(tick, (begin + tick) * 10**6, {key: float(rng.normal()) for key in keys}) for tick in ticks]
            streams[source] = rows_of(Stream(divider, rows), source)
            whole[source] += [(begin + row[0], *row[1:], min(divider, length - row[0])) for row in rows]
        named = [replace(one, divider=dividers.get(one.source, 1)) for one in ELEMENTS]
        parts.append((bind(text, Catalogue(named)), streams, length))
        begin += length
    before, found = None, []
    for bound, streams, length in parts:
        evaluator = Evaluator(bound)
        if before is not None:
            evaluator.follow(*before)
        found.append(evaluator.feed(streams).numbers())
        before = evaluator, length
    at_once = Evaluator(bind(text, CATALOGUE)).feed({
        source: replace(rows_of(Stream(1, rows), source), holds=np.array([row[3] for row in rows]))
        for source, rows in whole.items()
    })  # fmt: skip
    assert np.concatenate(found).tobytes() == at_once.numbers().tobytes()


def test_a_row_that_was_lost_is_unobservable_not_quiet():
    streams = {
        0: stream_of([(tick, 9.0) for tick in range(4)], 0, (0, 0)),
        1: stream_of([(0, 9.0)], 1, (1, 0)),
    }
    judged = Evaluator(bind("b > 5", CATALOGUE), bind("a > 5", CATALOGUE))
    found = judged.feed({source: rows_of(stream, source) for source, stream in streams.items()})
    assert found.codes(0).tolist() == [1, 1, -1, -1]
    assert found.codes(1).tolist() == [1, 1, 1, 1]


def test_an_expression_of_elements_that_are_off_is_never_judged():
    assert len(Evaluator(bind("gone > 3", CATALOGUE)).feed({}).ticks) == 0


def test_a_not_a_number_is_unobservable_and_can_be_asked_for():
    streams = {0: stream_of([(0, math.nan), (1, 1.0)], 0, (0, 0))}
    assert evaluated(bind("a > 0", CATALOGUE), streams)[1].tolist()[1:] == [1.0]
    assert math.isnan(evaluated(bind("a > 0", CATALOGUE), streams)[1][0])
    assert evaluated(bind("isnan(a)", CATALOGUE), streams)[1].tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    "text",
    ["mean(a, 37ms) - prev(b)", "std(a, 90ms) + rate(c)", "sum(diff(v * w))", "max(prev(v), 20ms) > mean(c > 0, 50ms)"],
)
@pytest.mark.parametrize("at", [0, 1, 77, 150])
def test_another_one_goes_on_with_the_same_bits_from_what_it_remembers(text, at):
    rng = np.random.default_rng(at)
    streams = {}
    for source, divider in DIVIDERS.items():
        keys = [(at, n) for at, e in enumerate(ELEMENTS) if e.source == source for n in range(len(e.entries))]
        streams[source] = Stream(divider, [
            (tick, tick * 10**6, {key: float(rng.normal()) for key in keys}) for tick in range(0, 300, divider)
        ])  # fmt: skip
    bound = bind(text, CATALOGUE)
    first, second = Evaluator(bound), Evaluator(bound)
    parts = [first.feed({source: rows_of(stream, source, -math.inf, at) for source, stream in streams.items()})]
    memory = msgspec.msgpack.decode(
        msgspec.msgpack.encode(first.memory(), enc_hook=array_parts), type=EvaluatorMemory, dec_hook=array_of
    )
    second.recall(memory)
    parts.append(second.feed({source: rows_of(stream, source, at) for source, stream in streams.items()}))
    found = np.concatenate([part.numbers() for part in parts])
    assert found.tobytes() == evaluated(bound, streams)[1].tobytes()
