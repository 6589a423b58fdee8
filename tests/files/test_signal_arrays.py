"""Signals are arrays: samples, stretches, masks, comparisons, NumPy's functions, with their units."""

import enum
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import silo
from silo.analysis.plots.curves import _seconds
from silo.analysis.reports import statistics

COUNT = 20


class Gait(enum.IntEnum):
    STAND = 0
    TROT = 1


@dataclass
class Leg:
    gait: Gait = Gait.STAND
    steps: int = 0


@dataclass
class State:
    gait: Gait = Gait.STAND
    height: float = 0.5
    leg: Leg = field(default_factory=Leg)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """20 ticks of 0.1 s: `x` in m counts, `y` is the same in mm every second tick, `q` an angle, `R` a matrix."""
    folder = tmp_path_factory.mktemp("arrays")
    ticks = iter(range(10**6))
    logger = silo.Logger(
        "arrays", frequency=10, folder=folder, script=folder / "no.yaml", clock=lambda: 10**18 + next(ticks) * 10**8
    )
    x, y, q = logger.array("x", unit="m"), logger.array("y", unit="mm", divider=2), logger.array("q", 3, unit="rad")
    matrix, gait, word = (
        logger.array("R", (2, 2)),
        logger.array("gait", dtype=int, labels=Gait),
        logger.array("w", (), "S4"),
    )
    large = logger.array("large", (), np.uint64)
    state, leg = State(), Leg()
    logger.add(state, "state")
    logger.add(leg, "leg")
    logger.start()
    for tick in range(COUNT):
        x[...], y[...], q[:], matrix[:], gait[...] = tick, 1000 * tick, tick / 10, [[tick, 1], [2, 3]], tick // 10
        word[...], large[...] = b"ab"[tick % 2 : tick % 2 + 1], 2**63 + tick
        state.gait = state.leg.gait = leg.gait = Gait(tick // 10)
        leg.steps = tick
        logger.collect()
    (saved,) = logger.save()
    logger.close()
    return silo.open_log(saved.path)


def times(signal):
    return np.round(signal.times, 6).tolist()


def test_whole_numbers_count_samples(log):
    assert log["x"][3] == 3
    assert log["x"][-1] == 19
    assert log["q"][3].tolist() == [0.3, 0.3, 0.3]
    assert log["x"][np.int64(3)] == 3


def test_a_slice_of_whole_numbers_is_one_of_samples(log):
    assert times(log["x"][2:5]) == [0.2, 0.3, 0.4]
    assert times(log["x"][::8]) == [0.0, 0.8, 1.6]


def test_a_slice_of_fractions_is_one_of_seconds_with_both_ends(log):
    assert times(log["x"][0.2:0.4]) == [0.2, 0.3, 0.4]
    assert times(log["x"][1.75:]) == [1.8, 1.9]
    assert times(log["x"][:0.15]) == [0.0, 0.1]
    assert log["x"][0.2:0.4].unit == "m"


def test_components_are_named_or_numbered(log):
    q = log["q"]
    assert q["y"].values.tolist() == q[:, 1].values.tolist()
    assert q[:, 1].name == "/log/q_y"
    assert q[5, "z"] == q[5, 2] == 0.5
    assert times(q[0.2:0.3, "x"]) == times(q[0.2:0.3, 0]) == [0.2, 0.3]
    assert q[:, 0:2].components == ("x", "y")
    assert log["R"][:, 0, 0].values.tolist() == list(range(20))
    assert log["R"][:, 1].values[0].tolist() == [2, 3]


def test_a_signal_of_one_sample_is_a_number_and_true_or_false(log):
    x = log["x"]
    assert (float(x[[3]]), float(x[[19]])) == (3.0, 19.0)
    assert (bool(x[[0]]), bool(x[[3]])) == (False, True)


def test_a_mask_chooses_samples(log):
    x = log["x"]
    assert x[x > 16].values.tolist() == [17, 18, 19]
    assert x[(x > 3) & (x < 6)].values.tolist() == [4, 5]
    assert x[~(x > 0)].values.tolist() == [0]
    assert x[x.values == 7].values.tolist() == [7]
    assert x[[1, 3]].values.tolist() == [1, 3]


def test_a_signal_is_a_sequence_of_its_samples(log):
    assert list(log["x"]) == list(range(20))
    assert len(log["x"]) == 20
    assert (log["q"].shape, log["q"].ndim, log["q"].size) == ((20, 3), 2, 60)


def test_comparisons_are_masks_at_the_stamps_of_both(log):
    mask = log["x"] == log["y"].to("m")
    assert mask.dtype == bool
    assert mask.unit == "-"
    assert mask.values.tolist() == [True, False] * 10
    assert (log["x"] >= 5).values.sum() == 15


def test_large_integers_are_compared_to_the_last_digit(log):
    assert (log["large"] == 2**63 + 3).values.tolist().index(True) == 3
    assert (log["large"] > 2**63 + 3).values.sum() == 16


def test_enumerations_and_texts_are_compared_by_their_words(log):
    assert (log["gait"] == "TROT").when().round(6).tolist() == [1.0]
    assert (log["gait"] != "TROT").values.sum() == 10
    assert (log["w"] == "a").values.sum() == 10
    for call in (lambda: log["w"] < "b", lambda: log["gait"] < "TROT"):
        with pytest.raises(silo.ElementError, match="compared by == and != to a text"):
            call()


def test_an_enumeration_that_is_a_field_has_its_labels(log):
    for one in (log["state"]["gait"], log["state"].component(0), log["state"]["leg_gait"], log["leg"][:, "gait"]):
        assert one.labels == {0: "STAND", 1: "TROT"}
        assert one.texts[[9, 10]].tolist() == ["STAND", "TROT"]
        assert (one == "TROT").when().tolist() == [1.0]
    assert log["leg"][5:]["gait"].labels == {0: "STAND", 1: "TROT"}
    assert log["state"]["height"].labels == log["leg"]["steps"].labels == log["leg"].labels == {}


def fields(*names):
    labels = {names[0]: {1: "TROT"}}
    values = np.arange(2 * len(names)).reshape(2, -1) % 3
    return silo.Signal("s", values, np.arange(2), components=names, component_labels=labels)


def test_fields_of_one_type_have_their_own_labels():
    one = replace(fields("gait", "steps"), values=np.ones((2, 2), int))
    assert one.texts.tolist() == [["TROT", "1"]] * 2
    assert one[:, 0].texts.tolist() == ["TROT"] * 2


def test_words_of_two_enumerations_are_compared_whatever_their_numbers():
    def signal(values, labels):
        return silo.Signal("gait", np.asarray(values), np.arange(len(values)), labels=labels)

    one, other = signal([0, 1, 5, 5], {0: "STAND", 1: "TROT"}), signal([1, 1, 5, 0], {0: "TROT", 1: "STAND"})
    assert (one == other).values.tolist() == [True, False, True, False]
    assert (one != other).values.tolist() == [False, True, False, True]
    more = signal([0, 1, 5, 5], {0: "STAND", 1: "TROT", 5: "RUN"})
    assert (one == more).all()
    missing = replace(other, values=np.ma.array(other.values, mask=[True, False, False, False]))
    assert (one == missing).values.tolist() == [False, False, True, False]
    assert (one[:0] == other[:0]).values.tolist() == []


def test_what_is_calculated_of_fields_has_no_labels():
    one = fields("gait", "steps")
    for made in (one * 2, -one, one > 0, one.derivative(), one.integral()):
        assert made["gait"].labels == {}


def test_a_part_of_a_structure_keeps_the_labels_of_its_fields():
    one = fields("leg_gait", "leg_steps", "arm_gait")
    assert one.part("leg")["gait"].labels == {1: "TROT"}
    assert one.part("arm")["gait"].labels == {}


def test_tables_have_the_words_of_an_enumeration_that_is_a_field(log):
    pytest.importorskip("pandas")
    pytest.importorskip("polars")
    assert log.to_pandas()["/log/state_gait"].tolist() == ["STAND"] * 10 + ["TROT"] * 10
    assert log["leg"].to_pandas()["/log/leg_gait"].tolist()[9:11] == ["STAND", "TROT"]
    assert log.to_pandas()["/log/leg_steps"].tolist() == list(range(COUNT))
    assert log.to_polars()["/log/state_leg_gait"].cast(str).to_list()[9:11] == ["STAND", "TROT"]


def test_signals_can_be_keys(log):
    x = log["x"]
    assert {x: 1}[x] == 1


@pytest.mark.parametrize(
    ("function", "unit"),
    [
        (np.sqrt, "m^0.5"),
        (np.square, "m^2"),
        (np.abs, "m"),
        (np.negative, "m"),
        (np.floor, "m"),
        (np.isnan, "-"),
        (np.sign, "-"),
        (lambda x: np.hypot(x, x), "m"),
        (lambda x: np.maximum(x, 3), "m"),
        (lambda x: np.arctan2(x, x), "rad"),
        (lambda x: np.multiply(2.0, x), "m"),
        (lambda x: np.ones(20) / x, "1/m"),
        (lambda x: np.clip(x, 1, 2), "m"),
        (np.round, "m"),
        (np.cumsum, "m"),
        (lambda x: x % 2, "m"),
        (lambda x: np.power(x, 2), "m^2"),
    ],
)
def test_functions_of_numpy_keep_the_unit_or_make_the_right_one(function, unit, log):
    made = function(log["x"])
    assert isinstance(made, silo.Signal)
    assert made.unit == unit
    with np.errstate(all="ignore"):
        assert np.array_equal(made.values, function(log["x"].values), equal_nan=True)


def test_a_function_of_numpy_leaves_no_names_of_values(log):
    named = replace(log["x"], labels={0: "STAND"}, component_labels={"": {0: "STAND"}})
    made = np.clip(named, 0, 1)
    assert (made.name, made.labels, made.component_labels) == ("clip(/log/x)", {}, {})


def test_angles_in_degrees_are_taken_as_such(log):
    q = log["q"]
    np.testing.assert_allclose(np.sin(q.to("deg")), np.sin(q.values), rtol=1e-15, atol=1e-15)
    assert np.sin(silo.Signal("a", np.array([0, 30]), np.arange(2), unit="deg")).values == pytest.approx([0, 0.5])
    assert np.sin(q).unit == "-"
    assert np.arcsin(np.sin(q[0:5])).unit == "rad"
    assert np.rad2deg(q).unit == "deg"


def test_reductions_of_numpy_are_plain_numbers(log):
    x = log["x"]
    for function in (np.mean, np.std, np.min, np.max, np.median, np.sum, np.ptp):
        assert function(x) == function(x.values)
    assert np.percentile(x, 50) == x.median() == 9.5
    assert x.mean() == np.mean(x) == 9.5
    assert x.var() == pytest.approx(x.std() ** 2)


def test_other_functions_take_the_plain_values(log):
    x = log["x"]
    assert np.diff(x).tolist() == [1.0] * 19
    assert np.where(x > 17, x, 0).sum() == 37
    assert np.concatenate([x, x]).shape == (40,)
    assert np.interp(0.55, x.times, x) == pytest.approx(5.5)
    assert np.fft.rfft(x).shape == (11,)


@pytest.mark.parametrize("dtype", ["int64", "uint64"])
def test_beside_a_division_by_zero_rests_of_large_numbers_are_right_to_the_last_digit(dtype):
    large = [2**62 + 1, 7, 2**62 + 5]
    one = silo.Signal("one", np.array(large, dtype), np.arange(3))
    rest = one % silo.Signal("other", np.array([1000, 0, 7], dtype), np.arange(3))
    np.testing.assert_array_equal(rest.values, [large[0] % 1000, np.nan, large[2] % 7])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda x, y, q: x[99], "'/log/x' has no sample 99: it has 20, counted from 0; seconds are written as "
         "fractions, [99.0:100.0], or .value(99)"),
        (lambda x, y, q: x[2.0], "'/log/x'[2]: samples are counted by whole numbers; write .value(2.0) for the "
         "value at a time, or [2.0:3.0] for a stretch of seconds"),
        (lambda x, y, q: x[None], "can't take None of '/log/x': write a number of a sample, a slice of samples "
         "[10:20] or of seconds [2.0:3.5], a mask, or the name of a component"),
        (lambda x, y, q: x["a":"b"], "bounds of '/log/x'[...] must be whole numbers of samples [10:20] or "
         "seconds [2.0:3.5], got slice('a', 'b', None)"),
        (lambda x, y, q: x[0.0:1.0:2], "a stretch of seconds of '/log/x' takes no step; write .clip(0.0, "
         "1.0)[::2], or .resample(10) for 10 Hz"),
        (lambda x, y, q: x[[True]], "a mask of '/log/x' must have one truth for each of its 20 samples, got "
         "shape (1,)"),
        (lambda x, y, q: x[[99]], "'/log/x' has 20 samples, not all of [99]"),
        (lambda x, y, q: x[x], "'/log/x' can't choose samples of '/log/x': it is no mask of one truth per "
         "sample (float64, shape (20,)); write a comparison, signal[signal['x'] > 1]"),
        (lambda x, y, q: y[x > 5], "'(/log/x > 5)' can't choose samples of '/log/y': their time stamps differ; "
         "write mask.resample(signal) first"),
        (lambda x, y, q: q["w"], "'/log/q' has no component 'w'; it has: x, y, z"),
        (lambda x, y, q: q[:, 7], "one sample of '/log/q' has shape (3,): can't take [7] of it (index 7 is out "
         "of bounds for axis 1 with size 3)"),
        (lambda x, y, q: x > y, "can't calculate '/log/x' > '/log/y': the unit of one is 'm', of the other "
         "'mm'; convert that one by .to('m')"),
        (lambda x, y, q: x == "TROT", "can't compare '/log/x' == 'TROT': its values are numbers without names"),
        (lambda x, y, q: bool(x), "'/log/x' has 20 samples, so it is neither true nor false: write .any(), "
         ".all() or len(...)"),
        (lambda x, y, q: x and y, "'/log/x' has 20 samples, so it is neither true nor false: write .any(), "
         ".all() or len(...)"),
        (lambda x, y, q: float(x), "'/log/x' has 20 samples: write .mean(), .value(time) or [0] for one number"),
        (lambda x, y, q: (x > 5) & x, "'(/log/x > 5)' & ... takes truths or whole numbers: write (a > 1) & (b "
         "< 2), with parentheses"),
        (lambda x, y, q: x.when(), "'/log/x' is no mask; write a comparison: (signal > 1).when()"),
        (lambda x, y, q: np.sin(x), "np.sin takes numbers or angles, but '/log/x' is in 'm'; divide it by a "
         "reference of that unit, or drop the unit by .with_unit('-')"),
        (lambda x, y, q: np.exp(x), "np.exp takes numbers or angles, but '/log/x' is in 'm'; divide it by a "
         "reference of that unit, or drop the unit by .with_unit('-')"),
        (lambda x, y, q: np.maximum(x, y), "can't calculate '/log/x' max '/log/y': the unit of one is 'm', of "
         "the other 'mm'; convert that one by .to('m')"),
        (lambda x, y, q: np.concatenate([x, y]), "np.concatenate of '/log/x' and '/log/y': the unit of one is "
         "'m', of the other 'mm'; convert one by .to(...), or take .values"),
        (lambda x, y, q: np.allclose(x, y.to("m")), "np.allclose of '/log/x' and '/log/y': they have samples "
         "at different times; write other.resample(one) first"),
        (lambda x, y, q: np.unwrap(q.to("deg")), "np.unwrap takes radians, but '/log/q' is in 'deg'; write "
         "np.unwrap(signal.to('rad'))"),
        (lambda x, y, q: np.deg2rad(q), "np.deg2rad takes 'deg', but '/log/q' is in 'rad'"),
        (lambda x, y, q: ~x, "np.invert has no meaning for signals; for plain arrays write signal.values"),
        (lambda x, y, q: np.modf(x), "np.modf has no meaning for signals; for plain arrays write signal.values"),
        (lambda x, y, q: np.add(x, 1, out=np.zeros(20)), "np.add can't write signals into an array (out=, or "
         "array += signal): write array = array + signal.values"),
        (lambda x, y, q: q.x, "a signal has no 'x': it is signal['x']"),
        (lambda x, y, q: x.time, "a signal has no 'time': it is .times (seconds since start) or .time_ns"),
        (lambda x, y, q: x.data, "a signal has no 'data': it is .values"),
        (lambda x, y, q: x.to("s"), "'/log/x' is in 'm', which can't be converted to 's'; if it is in 's' in "
         "truth, say so by .with_unit('s')"),
        (lambda x, y, q: x.to(), "signal.to() needs unit: write signal.to(unit)"),
        (lambda x, y, q: x.mean(start=1), "signal.mean() has no argument 'start', did you mean 'start_s'?; "
         "nothing was done"),
        (lambda x, y, q: x.plot(5), "plot takes signals, got 5; write log['/log/x'].plot(log['/log/y'])"),
        (lambda x, y, q: x.plot(ax=5), "ax must be axes of matplotlib, got 5; write figure, ax = plt.subplots()"),
        (lambda x, y, q: x[5:5].plot(y[5:5]),
         "there is nothing to plot: '/log/x' has no sample, '/log/y' has no sample"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_told_of(call, words, log):
    with pytest.raises(silo.SiloError) as caught:
        call(log["x"], log["y"], log["q"])
    assert str(caught.value) == words


def test_a_wrong_place_is_an_index_error_too(log):
    with pytest.raises(IndexError):
        log["x"][99]


def test_plots_are_text_where_there_is_no_screen_and_files_on_demand(log, capsys, tmp_path, monkeypatch):
    log["x"].plot(log["q"], terminal=True)
    printed = capsys.readouterr().out
    assert "/log/x [m] (left)" in printed
    assert "/log/q_z [rad] (right)" in printed
    path = log["x"].plot(path=tmp_path / "x.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_plot_is_drawn_on_given_axes(log):
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    assert log["x"].plot(ax=axes) is axes
    assert axes.lines[0].get_ydata().tolist() == list(range(20))


def test_notebooks_see_the_first_samples(log):
    assert "<th>x</th><th>y</th><th>z</th>" in log["q"]._repr_html_()
    assert "and 12 more samples" in log["q"]._repr_html_()


def test_the_type_that_is_asked_for_is_given_or_refused():
    one = silo.Signal("s", np.arange(4.0), np.arange(4), unit="m")
    assert np.add(one, 1, dtype=np.float32).dtype == np.float32
    assert np.add(one, 1, dtype=np.float32).values.tolist() == [1, 2, 3, 4]
    assert np.sqrt(one, dtype=np.float32).dtype == np.float32
    with pytest.raises(silo.ElementError, match=r"np.add can't give int32: the result is float64"):
        np.add(one, 1, dtype=np.int32)


def test_an_operator_with_assignment_makes_another_signal_and_leaves_the_first_alone(log):
    one = first = log["x"]
    one += 1
    one *= 2
    assert (one.name, one.unit, one.values[:2].tolist()) == ("((/log/x + 1) * 2)", "m", [2, 4])
    assert first.values[:2].tolist() == [0, 1]
    with pytest.raises(silo.ElementError, match="can't write signals into an array"):
        np.add(first, 1, out=first)


def test_every_operator_of_numpy_is_one_of_signals(log):
    gait = log["gait"]
    assert (1 << gait).values.tolist() == [1] * 10 + [2] * 10
    assert (-log["x"]).name == "-/log/x"
    assert abs(log["x"]).name == "abs(/log/x)"
    assert (log["x"] == None) is False  # noqa: E711
    with pytest.raises(silo.ElementError, match="has no meaning for signals"):
        divmod(gait, 2)


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
class TestStamps:
    """Integers of which a float64 tells no two within 256 apart: stamps in ns."""

    BEGIN = 1_790_000_000_000_000_000

    def stamps(self, dtype, steps=(0, 3, 4, 9)):
        values = (self.BEGIN + np.array(steps)).astype(dtype)
        return silo.Signal("sent", values, np.arange(len(values)) * 10**9)

    def test_differences_are_exact(self, dtype):
        sent, received = self.stamps(dtype), self.stamps(dtype, (5, 1, 4, 10))
        assert (received - sent).values.tolist() == [5, -2, 0, 1]
        assert (sent - sent.values[0]).values.tolist() == [0, 3, 4, 9]
        assert (sent - self.BEGIN).values.tolist() == [0, 3, 4, 9]

    def test_products_and_large_sums_do_not_wrap(self, dtype):
        sent = self.stamps(dtype)
        if dtype is np.uint64:
            assert (sent * sent).values[0] == pytest.approx(float(self.BEGIN) ** 2)
            assert (sent + np.uint64(2**63)).values[0] == pytest.approx(float(self.BEGIN + 2**63))
        if dtype is np.uint64:
            for high in (2**62, 2**63):
                far = sent + np.uint64(high)
                assert far.values.tolist() == [int(value) + high for value in sent.values]
                assert (far - far.values[0]).values.tolist() == [0, 3, 4, 9]
                assert (sent - far).values.tolist() == [-high] * 4
            assert ((sent * 5) - sent.values[0] * np.uint64(5)).values.tolist() == [0, 15, 20, 45]
        masked = np.ma.masked_array(sent.values, [True, False, False, True])
        assert (replace(sent, values=masked) + 1).values[1] == pytest.approx(self.BEGIN + 4)
        assert replace(sent, values=masked).std() == pytest.approx(0.5)
        none = replace(sent, values=np.ma.masked_array(sent.values, True))
        assert np.ma.getmaskarray((none + 1).values).all()

    def test_what_is_no_larger_than_whole_numbers_keeps_their_digits(self, dtype):
        high = 2**63 if dtype is np.uint64 else 0
        sent = self.stamps(dtype) + dtype(high)
        numbers = [int(value) for value in sent.values]
        assert numbers == [self.BEGIN + high + step for step in (0, 3, 4, 9)]
        for made, expected in (
            (sent % 10, [one % 10 for one in numbers]),
            (sent // 3, [one // 3 for one in numbers]),
            (sent & 0xFF, [one & 0xFF for one in numbers]),
            (sent >> 2, [one >> 2 for one in numbers]),
            (np.maximum(sent, sent.values[1]), [max(one, numbers[1]) for one in numbers]),
            (abs(sent), numbers),
            ((sent // 4) * 2, [one // 4 * 2 for one in numbers]),
        ):
            assert made.values.tolist() == expected
        assert np.isinf((sent // 0).values).all() if high else True
        assert (-(sent - sent.values[0])).values.tolist() == [0, -3, -4, -9]

    def test_what_does_not_depend_on_where_zero_is_is_exact(self, dtype):
        sent = self.stamps(dtype)
        assert sent.std() == pytest.approx(np.std([0, 3, 4, 9]))
        assert sent.var() == pytest.approx(np.var([0, 3, 4, 9]))
        assert sent.derivative().values.tolist() == np.gradient([0.0, 3.0, 4.0, 9.0]).tolist()
        assert statistics(sent).std == pytest.approx(np.std([0, 3, 4, 9]))
        assert (statistics(sent).minimum, statistics(sent).maximum) == (self.BEGIN, self.BEGIN + 9)
        assert type(statistics(sent).maximum) is int

    def test_so_it_is_per_component(self, dtype):
        values = np.stack([self.stamps(dtype).values, np.array([1, 2, 3, 4], dtype)], axis=1)
        both = silo.Signal("both", values, np.arange(4) * 10**9)
        assert both.std().tolist() == pytest.approx([np.std([0, 3, 4, 9]), np.std([1, 2, 3, 4])])
        assert both.derivative().values[:, 1].tolist() == [1.0] * 4


class TestNumpysStatistics:
    @pytest.mark.parametrize("name", ["max", "min", "mean", "std", "var", "median"])
    def test_of_one_component_they_are_the_methods(self, name, recwarn):
        q = silo.Signal("q", np.array([1.0, 5.0, 3.0]), np.arange(3))
        assert getattr(np, name)(q) == getattr(q, name)()
        assert not recwarn.list

    @pytest.mark.parametrize("name", ["max", "min", "mean", "std", "var", "median"])
    def test_of_several_they_are_the_methods_too_and_say_how_to_have_numpys_own(self, name):
        q = silo.Signal("q", np.array([[1.0, 5.0], [np.nan, 3.0]]), np.arange(2))
        with pytest.warns(silo.LogWarning, match=rf"write np\.{name}\(signal\.values\) for the former"):
            made = getattr(np, name)(q)
        assert np.array_equal(made, getattr(q, name)())


def test_a_mask_or_a_rule_of_numpy_gives_plain_numbers(log):
    x = log["x"]
    mask = np.arange(len(x)) < 2
    assert np.add(x, 1, where=mask, out=None)[:2].tolist() == [1.0, 2.0]
    made = np.add(x, 1, casting="same_kind")
    assert type(made) is np.ndarray
    assert made.tolist() == (x.values + 1).tolist()
    assert np.add(x, x, dtype=np.float32).values.dtype == np.float32


def test_of_a_time_that_is_none_nothing_is_drawn():
    for kind in ("M8[ms]", "m8[ms]"):
        np.testing.assert_array_equal(_seconds(np.array([1500, "NaT"], kind)), [1.5, np.nan])


@pytest.mark.parametrize(
    "key, meant",
    [
        (slice(-1.0, None), "[8.9:]"),
        (slice(None, -1.0), "[:8.9]"),
        (slice(-2.5, -1.0), "[7.4:8.9]"),
        (slice(1.0, -1.0), "[1.0:8.9]"),
        (slice(np.float32(-1), None), "[8.9:]"),
    ],
)
def test_seconds_below_0_say_how_they_are_counted_from_the_end(key, meant):
    signal = silo.Signal("q", np.arange(100), np.arange(100) * 10**8 + 5, start_ns=5)
    with pytest.raises(silo.ElementError, match="seconds count from the start, and it has samples from 0 to") as told:
        signal[key]
    assert str(told.value).endswith(f"counted from its end that is {meant}")


def test_seconds_around_a_moment_at_the_start_and_before_what_times_count_from_are_taken():
    signal = silo.Signal("q", np.arange(100), np.arange(100) * 10**8)
    assert len(signal[-0.5:0.5]) == 6
    assert len(signal.counted_from(5 * 10**9)[-1.0:]) == 60
    assert len(signal.counted_from(5 * 10**9)[:-1.0]) == 41
