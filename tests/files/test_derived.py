"""Derived signals in files: columns like any other, with their definitions, computed once."""

import dataclasses
import math

import numpy as np
import pytest

import silo
from silo.analysis.check import check
from silo.analysis.log import Log
from silo.core.conditions import Conditions, Derived
from silo.core.elements import BufferType
from silo.core.recording import Recording
from silo.expressions.derived_samples import with_derived_samples
from silo.files import write
from silo.files.convert import convert
from silo.files.formats import read_recording
from tests.files.test_silo_round_trip import mini_reader, original_stamps
from tests.stand_ins.saved import element


def recording(*elements, derived=(), ticks=12):
    time_ns = 10**18 + np.arange(ticks) * 10**6
    conditions = Conditions(tuple(Derived(f"/log/{name}", text) for name, text in derived))
    return Recording("robot", time_ns, ticks, elements, frequency_hz=1000.0, conditions=conditions)


@pytest.fixture
def logged():
    return recording(
        element("x", np.arange(12.0)),
        element("third", np.arange(4.0), divider=3),
        element("late", np.arange(3.0), divider=2, first=6),
        derived=(("twice", "2 * x"), ("sum", "twice + third"), ("slow", "late - third"), ("high", "x > 5")),
    )


def columns(found):
    return {one.name: one.entries[0].values.tolist() for one in found.elements}


@pytest.mark.parametrize("ending", ["silo", "csv", "mcap", "rosbag2"])
def test_every_format_has_them_as_columns_and_keeps_what_they_are(logged, tmp_path, ending):
    write(logged, tmp_path, "robot", ["silo"], "run")
    target = tmp_path / f"other.{ending}"
    convert(tmp_path / "run.silo", target)
    found = read_recording(target)
    assert columns(found)["/log/twice"] == [2.0 * at for at in range(12)]
    assert columns(found)["/log/high"] == [at > 5 for at in range(12)]
    assert found.conditions == logged.conditions
    assert [one.description for one in found.elements if one.name == "/log/sum"] == ["= twice + third"]


def test_what_is_read_back_is_not_computed_again(logged, tmp_path):
    write(logged, tmp_path, "robot", ["silo"], "run")
    found = read_recording(tmp_path / "run.silo")
    assert with_derived_samples(found) is found
    kept = dataclasses.replace(found, elements=[one for one in found.elements if one.name != "/log/x"])
    assert Log(kept)["twice"].values.tolist() == [2.0 * at for at in range(12)]
    assert list(Log(found)).count("/log/twice") == 1


def test_signals_of_different_rates_are_told_at_their_common_ticks(logged):
    found = {one.name: one for one in with_derived_samples(logged).elements}
    assert columns(with_derived_samples(logged))["/log/sum"] == [2.0 * at + at // 3 for at in range(12)]
    slow = found["/log/slow"]
    assert (slow.first, slow.divider) == (6, 1)
    assert slow.entries[0].values.tolist() == [(at - 6) // 2 - at // 3 for at in range(6, 12)]


def test_where_one_of_its_signals_ended_nothing_is_told():
    found = with_derived_samples(
        recording(
            element("x", np.arange(12.0)),
            element("short", np.arange(5.0), buffer_type=BufferType.FIXED),
            derived=(("sum", "x + short"), ("either", "x > 3 or short > 2")),
        )
    )
    assert repr(columns(found)["/log/sum"]) == repr([0.0, 2.0, 4.0, 6.0, 8.0, *[math.nan] * 7])
    assert repr(columns(found)["/log/either"]) == repr([0.0, 0.0, 0.0, 1.0, 1.0, *[math.nan] * 7])


@pytest.mark.parametrize(
    ("overwritten", "first", "unknown"), [(0, 0, 0), (0, 6, 4), (100, 0, 4)], ids=["whole", "of one", "of all"]
)
def test_a_window_that_reaches_back_before_what_is_kept_tells_nothing(overwritten, first, unknown):
    x = element("x", np.arange(12.0 - first), first=first)
    derived = (("mean", "mean(x, 4ms)"), ("high", "mean(x, 4ms) > 3"), ("twice", "2 * x"), ("both", "max(mean, x)"))
    made = recording(x, derived=derived)
    found = columns(with_derived_samples(dataclasses.replace(made, offset=12 + overwritten)))
    means = [np.mean([*range(max(0, at - 3), at + 1)]) for at in range(12 - first)]
    lost = [math.nan] * unknown
    assert repr(found["/log/mean"]) == repr([*lost, *map(float, means[unknown:])])
    highs = [bool(mean > 3) for mean in means[unknown:]]
    assert repr(found["/log/high"]) == repr([*lost, *map(float, highs)] if unknown else highs)
    assert found["/log/twice"] == [2.0 * at for at in range(12 - first)]
    assert repr(found["/log/both"][:unknown]) == repr(lost)
    log = Log(dataclasses.replace(made, offset=12 + overwritten, conditions=Conditions()))
    assert log.eval("mean(x, 4ms)").values.tolist() == means[unknown:]
    assert log.eval("mean(x, 4ms) > 3").values.tolist() == highs
    (found,) = check(log.recording, [], never=["mean(x, 4ms) < 1"])
    assert (found.worst, found.samples) == (("GREEN", 0) if unknown else ("VIOLATED", 2))


def test_the_readers_of_the_original_get_their_values_and_time_stamps(tmp_path):
    made = recording(
        element("x", np.arange(8.0), first=4),
        element("third", np.arange(3.0), divider=3, first=3),
        element("short", np.arange(9.0), buffer_type=BufferType.GROWING),  # of a buffer that keeps its first samples
        derived=(("sum", "x + third"), ("brief", "x + short"), ("double", "2 * short")),
    )
    write(made, tmp_path, "robot", ["silo"], "run")
    offset, entries = mini_reader(tmp_path / "run.silo")
    by_name = {name: (samples, divider, looping, data) for name, _, samples, divider, looping, _, data in entries}
    for name, stamps, values in (
        ("/log/sum", range(4, 12), [at - 4 + (at // 3 - 1) for at in range(4, 12)]),
        ("/log/brief", range(4, 12), [0 + 4, 1 + 5, 2 + 6, 3 + 7, 4 + 8, np.nan, np.nan, np.nan]),
        ("/log/double", range(9), [2 * at for at in range(9)]),
    ):
        samples, divider, looped, data = by_name[name]
        assert original_stamps(looped, 12, samples, divider, offset) == list(stamps)
        np.testing.assert_array_equal(np.frombuffer(data), values)


def test_what_can_not_be_computed_is_told_once(tmp_path):
    made = recording(element("x", np.arange(12.0)), derived=(("power", "x * gone"),))
    write(made, tmp_path, "robot", ["silo"], "run")
    convert(tmp_path / "run.silo", tmp_path / "run.csv")
    warnings = read_recording(tmp_path / "run.csv").warnings
    assert [text for text in warnings if "/log/power = x * gone is not in it: no signal is named 'gone'" in text] != []
    assert sum("/log/power" in text for text in warnings) == 1


def test_a_log_in_a_notebook_lists_them(logged):
    assert "/log/sum" in Log(logged)._repr_html_()


@pytest.mark.parametrize("served", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_logger_saves_what_was_derived_while_it_ran(tmp_path, runtime_folder, served):
    with silo.Logger("derived", frequency=100, folder=tmp_path, script=tmp_path / "s.yaml") as log:
        x = log.array("x")
        if served:
            log.serve()
        log.start()
        log.derive("twice", "2 * x", unit="V")
        for at in range(20):
            x[...] = at
            log.collect()
        log.stop()
        (file, bag) = log.save(["silo", "bag"])
    for path in (file.path, bag.path):
        found = silo.open_log(path)
        assert found["twice"].values.tolist() == [2.0 * at for at in range(20)]
        assert found["twice"].unit == "V"
        assert [one.name for one in found.recording.conditions.derived] == ["/log/twice"]


@pytest.mark.parametrize(
    ("expression", "unit"),
    [("x ** 2", "m^2"), ("2 ** k", "-"), ("x * y", "m*s"), ("x / y", "m/s"), ("x + 1m", "m"), ("x ** k", "-")],
)
def test_a_product_has_the_unit_of_its_factors(expression, unit):
    units = {"x": "m", "y": "s", "k": "-"}
    elements = [element(name, np.arange(12.0), of) for name, of in units.items()]
    made = with_derived_samples(recording(*elements, derived=(("made", expression),))).elements[-1]
    assert (made.name, made.unit) == ("/log/made", unit)
