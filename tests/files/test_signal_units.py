"""What becomes of units when signals are calculated with: nothing is dropped, nothing is added that doesn't fit."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import silo
from silo.analysis.signal import Signal
from silo.core import units
from silo.errors import ElementError, LogWarning


def signal(unit, values=(1.0, 2.0, 3.0), name=None):
    values = np.asarray(values)
    return Signal(name or f"/{unit}", values, 10**18 + np.arange(len(values)) * 10**9, unit=unit, start_ns=10**18)


class TestProducts:
    @pytest.mark.parametrize(
        ("one", "other", "expected"),
        [
            ("rad/s", "s", "rad"),
            ("Nm", "rad/s", "W"),
            ("V", "A", "W"),
            ("N", "m/s", "W"),
            ("W", "s", "J"),
            ("N", "m", "N*m"),  # a torque, or an energy
            ("mNm", "rad/s", "mNm*rad/s"),
            ("m/s²", "s", "m/s"),
            ("m/s^2", "kg", "m*kg/s^2"),
            ("m/s2", "s", "m/s"),
            ("m/s**2", "s^2", "m"),
            ("1/s", "s", "-"),
            ("Nm/rad", "rad", "Nm"),
            ("N·m", "1/m", "N"),
            ("kg m", "1/kg", "m"),
            ("kg m^2 s^-2", "s^2", "kg*m^2"),
            ("(m/s)^2", "s", "m^2/s"),
            ("[raw * 2]/s", "s", "raw * 2"),
            ("rad/s/s", "s", "rad/s"),
            ("kg/(m*s)", "s", "kg/m"),
            ("m s⁻¹", "s", "m"),
            ("-", "m/s²", "m/s²"),
            ("m/s²", "", "m/s²"),
            ("-", "-", "-"),
            ("ticks", "1/ticks", "-"),
            ("raw counts", "s", "raw counts*s"),
            ("raw counts*s", "1/s", "raw counts"),
            ("%", "s", "%*s"),
        ],
    )
    def test_what_cancels_is_gone_and_the_rest_stays_as_written(self, one, other, expected):
        assert (signal(one) * signal(other)).unit == expected

    def test_a_quotient_of_equal_units_has_none(self):
        assert (signal("Nm") / signal("Nm")).unit == "-"
        assert (signal("m/s²") / signal("m/s^2")).unit == "-"

    def test_a_number_divided_by_a_signal_turns_its_unit_over(self):
        assert (1 / signal("rad/s")).unit == "s/rad"
        assert (1 / signal("-")).unit == "-"

    def test_derivative_and_integral_undo_each_other_in_the_unit_too(self):
        position = signal("rad")
        assert position.derivative().derivative().unit == "rad/s^2"
        assert position.derivative().integral().unit == "rad"
        assert signal("rad/s").integral().unit == "rad"

    def test_powers_multiply(self):
        assert (signal("m/s") ** 2).unit == "m^2/s^2"
        assert (signal("m^2") ** 0.5).unit == "m"
        assert (signal("m") ** 0.5).unit == "m^0.5"
        assert (signal("m") ** 0).unit == "-"
        assert (signal("m") ** -1).unit == "1/m"

    def test_an_exponent_must_be_one_number_without_a_unit(self):
        with pytest.raises(ElementError, match=r"'/s' .*unit 's'.*with_unit\('-'\)"):
            signal("-") ** signal("s")
        with pytest.raises(ElementError, match=r"'/m' .*unit 'm'.*with_unit\('-'\)"):
            signal("m") ** np.array([1.0, 2.0, 3.0])
        assert (signal("-") ** np.array([1.0, 2.0, 3.0])).unit == "-"

    @pytest.mark.parametrize("base", [2, 2.0, np.float64(2), np.int64(2)])
    def test_the_exponent_of_a_number_must_have_no_unit(self, base):
        for power in (lambda q: np.power(base, q), lambda q: base**q):
            with pytest.raises(ElementError, match=r"'/m' can't be an exponent: it has the unit 'm'"):
                power(signal("m"))
            assert (power(signal("-")).unit, power(signal("-")).values.tolist()) == ("-", [2, 4, 8])

    def test_a_number_stands_before_every_operator(self):
        assert (7 % signal("-")).values.tolist() == [0, 1, 1]
        assert (7 // signal("s")).values.tolist() == [7, 3, 2]
        assert (7 // signal("s")).unit == "1/s"

    @pytest.mark.parametrize("text", ["a/(b", "m^", "*", "/s", "m//s", "(", "a)b", "5 of 7", "m/s/", "µ", "kg*-"])
    def test_what_is_no_formula_stays_one_opaque_word_that_still_cancels(self, text):
        product = signal(text) * signal("s")
        assert (product / signal("s")).unit == (signal(text) * signal("-")).unit
        assert (product / signal(text)).unit == "s"


class TestSums:
    def test_equal_units_stay_as_written(self):
        assert (signal("m/s²") + signal("m/s²")).unit == "m/s²"

    def test_the_same_unit_in_other_words_is_the_same(self):
        assert (signal("Nm") + signal("N*m")).unit == "Nm"
        assert (signal("m/s²") - signal("m/s^2")).unit == "m/s²"
        assert (signal("J") + signal("Nm*rad")).unit == "J"
        assert (signal("W") + signal("Nm*rad/s")).unit == "W"
        assert (signal("m/s") + signal("rad/s*m")).unit == "m/s"

    def test_a_signal_without_a_unit_takes_the_other_ones(self):
        assert (signal("-") + signal("Nm")).unit == "Nm"
        assert (signal("Nm") + signal("")).unit == "Nm"
        assert (signal("Nm") + 1).unit == "Nm"

    def test_a_position_and_a_speed_are_not_added(self):
        with pytest.raises(
            ElementError,
            match=r"can't calculate '/rad' \+ '/rad/s': the unit of one is 'rad', of the other 'rad/s'.*\.with_unit",
        ):
            signal("rad") + signal("rad/s")

    @pytest.mark.parametrize(
        ("one", "other"), [("m", "s"), ("Hz", "rad/s"), ("rpm", "Hz"), ("°C", "K"), ("ticks", "m"), ("raw a", "raw b")]
    )
    def test_units_that_mean_different_things_are_not_added(self, one, other):
        with pytest.raises(ElementError, match="with_unit"):
            signal(one) + signal(other)
        with pytest.raises(ElementError, match="with_unit"):
            signal(other) - signal(one)

    @pytest.mark.parametrize(
        ("one", "other"), [("m", "mm"), ("rad", "deg"), ("rad/s", "rpm"), ("s", "ms"), ("Nm", "mNm")]
    )
    def test_units_of_different_size_are_not_added_and_it_is_said_how_to_convert(self, one, other):
        with pytest.raises(ElementError, match=rf"to\('{one}'\)"):
            signal(one) + signal(other)

    def test_dropping_the_unit_lets_them_meet(self):
        assert (signal("rad") + signal("rad/s").with_unit("-")).unit == "rad"


class TestConversion:
    @pytest.mark.parametrize(
        ("unit", "to", "factor"),
        [
            ("mm", "m", 1e-3),
            ("deg", "rad", np.pi / 180),
            ("rpm", "rad/s", np.pi / 30),
            ("km/h", "m/s", 1 / 3.6),
            ("kNm", "N*m", 1000.0),
            ("bar", "Pa", 1e5),
            ("m", "m", 1.0),
            ("min", "s", 60.0),
            ("µs", "s", 1e-6),
            ("us", "μs", 1.0),
            ("kWh", "J", 3.6e6),
            ("g", "kg", 1e-3),
            ("ticks/ms", "ticks/s", 1000.0),
        ],
    )
    def test_values_are_multiplied(self, unit, to, factor):
        converted = signal(unit).to(to)
        np.testing.assert_allclose(converted.values, factor * np.array([1.0, 2.0, 3.0]), rtol=1e-14)
        assert (converted.unit, converted.name) == (to, f"/{unit}")

    def test_what_can_not_be_converted_is_told(self):
        with pytest.raises(ElementError, match=r"'/rad' is in 'rad', which can't be converted to 'm'"):
            signal("rad").to("m")
        with pytest.raises(ElementError, match="'°C'"):
            signal("°C").to("K")

    def test_a_word_that_is_not_known_is_told_with_the_one_that_is_meant(self):
        with pytest.raises(ElementError, match=r"doesn't know 'radians', did you mean 'rad'\?"):
            signal("radians").to("deg")
        with pytest.raises(ElementError, match=r"doesn't know 'sec', did you mean 'm/s'\?"):
            signal("mm/s").to("m/sec")
        with pytest.warns(LogWarning, match=r"did you mean 'rad'\?.*the next release will refuse it"):
            signal("-").with_unit("rd")

    @pytest.mark.parametrize(
        "turned",
        [
            lambda q: q * 180 / np.pi,
            lambda q: q * (180 / np.pi),
            lambda q: 57.3 * q,
            lambda q: np.multiply(q, 57.29578),
            lambda q: q / (math.pi / 180),
        ],
    )
    def test_degrees_that_would_stay_in_rad_are_told(self, turned):
        with pytest.warns(LogWarning, match=r"stays in 'rad'.*\.to\('deg'\)"):
            turned(signal("rad"))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            turned(signal("-"))
            signal("rad") * 2.0
            signal("rad") * 180

    @pytest.mark.parametrize(
        ("unit", "meant"),
        [
            ("radians", "rad"), ("rd", "rad"), ("Degrees", "deg"), ("rad/sec", "rad/s"), ("meters", "m"), ("hz", "Hz"),
            ("RPM", "rpm"), ("Volt", "V"), ("kgs*m", "kg*m"), ("NM", "Nm"), ("celsius", "degC"),
        ],
    )  # fmt: skip
    def test_what_is_meant_by_a_word(self, unit, meant):
        assert f"did you mean '{meant}'?" in units.doubt(unit)
        assert units.doubt(meant) == ""

    @pytest.mark.parametrize(
        "unit", ["", "-", "Nm", "m/s²", "kg m^2 s^-2", "[raw counts]", "[parsec]/s", "%", "count", "degC", "µs", "1/s"]
    )
    def test_known_words_and_those_in_brackets_are_no_doubt(self, unit):
        assert units.doubt(unit) == ""

    @pytest.mark.parametrize(
        ("unit", "to", "by"),
        [
            ("lux", "lx", 1), ("lx", "lm/m^2", 1), ("gauss", "mT", 0.1), ("Nms", "N*m*s", 1), ("kph", "m/s", 1 / 3.6),
            ("km/h", "kph", 1), ("Wb", "V*s", 1), ("psi", "kPa", 6.894757293168361), ("ft", "inch", 12),
            ("day", "h", 24), ("kn", "km/h", 1.852), ("lbf", "N", 4.4482216152605), ("mmHg", "Pa", 133.322387415),
        ],
    )  # fmt: skip
    def test_units_of_other_trades_have_a_meaning(self, unit, to, by):
        assert units.doubt(unit) == ""
        assert units.factor(unit, to) == pytest.approx(by)

    @pytest.mark.parametrize("word", ["bool", "enum", "normalized", "ratio", "flags", "state", "unitless", "id", "raw"])
    def test_words_without_a_dimension_are_no_doubt_and_combine_like_all_others(self, word):
        assert units.doubt(word) == ""
        assert units.doubt(f"{word}/s") == ""
        assert units.factor(word, "m") is None

    def test_another_word_is_doubted_with_the_way_to_write_it(self):
        assert units.doubt("parsec/s").endswith("doesn't know 'parsec'; a word of your own is written '[parsec]/s'")

    def test_whole_numbers_become_fractions(self):
        assert signal("mm", [1, 2]).to("m").values.tolist() == [0.001, 0.002]

    def test_with_unit_changes_no_value(self):
        relabelled = signal("mm").with_unit("m")
        assert (relabelled.unit, relabelled.values.tolist()) == ("m", [1, 2, 3])


# a word in brackets is quoted; unpaired brackets can't be, so such units do not cancel
TEXTS = st.text(st.characters(exclude_characters="[]"), max_size=12) | st.text("ms*/^()2-1 ·²k", max_size=12)


@given(TEXTS, TEXTS)
def test_any_text_is_a_unit_that_combines_and_cancels(one, other):
    made = units.product(one, other)
    assert units.same(units.quotient(made, other), one)
    assert units.same(one, one)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("ms > 5ms", [False, False, True]), ("us > 5ms", [False, False, True]),
        ("ms > 0.005s", [False, False, True]), ("ms - us", [0, 0, 0, math.nan]),
        ("hours == days", [True, False, False, False]),
        ("days > 23h", [False, True, True, True]), ("when_s == when_ms", [True] * 4),
        ("when_ms - when_s < 1us", [True] * 4), ("max(ms, us) < 7ms", [True, True, True]),
        ("diff(minutes) > 59s", [True, True, True]), ("ms + 1s > 1.0055s", [False, False, True]),
    ],
)  # fmt: skip
def test_durations_and_dates_have_the_unit_that_they_count(tmp_path, expression, expected):
    log = silo.Logger("td", folder=tmp_path, frequency=100, script=tmp_path / "none.yaml")
    units = {"ms": "m8[ms]", "us": "m8[us]", "hours": "m8[h]", "days": "m8[D]", "minutes": "m8[m]"}
    units |= {"when_s": "M8[s]", "when_ms": "M8[ms]"}
    made = {name: log.array(name, (), dtype) for name, dtype in units.items()}
    log.start()
    for tick, lasts in enumerate((4, 5, 6, None)):
        for name in ("ms", "us"):
            made[name][...] = np.timedelta64("NaT") if lasts is None else np.timedelta64(lasts, "ms")
        made["hours"][...], made["days"][...] = 24 * tick + tick, tick
        made["minutes"][...] = tick
        for name in ("when_s", "when_ms"):
            made[name][...] = np.datetime64(1_700_000_000 + tick, "s")
        log.collect()
    saved = log.save("silo")
    log.close()
    found = silo.open_log(saved.path).eval(expression)  # what can't be told is left out
    assert found.values.tolist() == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize(
    "expression",
    ["abs(z)", "z * z", "z == 3", "max(z)", "-z > 0", "norm(z + 1)", "zz > 1", "all(diff(z) > 0)", "2 / z"],
)
def test_parts_of_complex_numbers_are_not_calculated_with_as_if_they_were_numbers(tmp_path, expression):
    log = silo.Logger("cx", folder=tmp_path, frequency=100, script=tmp_path / "none.yaml")
    z, zz = log.array("z", (), "c16"), log.array("zz", 2, "c16")
    log.array("zz_as_one", (), "c8")
    log.array("pair", (), [("real", "f8"), ("imag", "f8")])[...] = 2, 2
    log.start()
    for tick in range(3):
        z[...], zz[:] = 3 + 4j * tick, (1j, 2)
        log.collect()
    found = silo.open_log(log.save("silo").path)
    with pytest.raises(ElementError, match=r"'zz?' is complex.*name its parts, as z(z_0)?_real"):
        found.eval(expression)
    assert found.eval("norm(z)").values.tolist() == [3.0, 5.0, math.hypot(3, 8)]
    assert found.eval("norm(diff(z))").values.tolist()[1:] == [4.0, 4.0]
    assert found.eval("norm(-z * 2 + z / 2 - zz_as_one)").values.tolist()[0] == 4.5
    assert found.eval("max(pair) + abs(pair)").values[0].tolist() == [4.0, 4.0]
    assert found.eval("z_imag + zz_1_real").values.tolist() == [2.0, 6.0, 10.0]


@pytest.mark.parametrize("dtype", ["m8[10ms]", "m8[ps]", "M8[W]"])
def test_steps_that_have_no_unit_are_told(tmp_path, dtype):
    log = silo.Logger("st", folder=tmp_path, frequency=100, script=tmp_path / "none.yaml")
    log.array("late", (), dtype)
    log.start()
    log.collect()
    with pytest.raises(ElementError, match=r"'/log/late' counts what has no unit here.*log it as m8\[ms\]"):
        silo.open_log(log.save("silo").path).eval("late > 5ms")
