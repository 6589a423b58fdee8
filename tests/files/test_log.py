"""`open_log`, `Log` and `Signal`: names to signals, values at times, statistics, arithmetic, frames, tables."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import silo
from silo.analysis.log import Log
from silo.analysis.opening import open_log
from silo.analysis.signal import Signal
from silo.core.elements import BufferType
from silo.core.recording import Recording, distinct
from silo.errors import ElementError, LogWarning, UnknownNameError, UnknownSignalError
from silo.files import write
from silo.files.silo.reader import read_silo


def signal(values, step_s=0.5, start_s=0.0, name="s", **more):
    values = np.asarray(values)
    time_ns = 10**18 + np.round((start_s + np.arange(len(values)) * step_s) * 1e9).astype(np.int64)
    components = more.pop("components", tuple("xyzw"[: values.shape[1]]) if values.ndim == 2 else ())
    return Signal(name, values, time_ns, start_ns=10**18, components=components, **more)


@pytest.fixture
def log(plan, recorded, tmp_path):
    plans = [
        plan("/log/imu/acc", kind="vector", unit="m/s²", description="of the base"),
        plan("/log/imu/q", kind="quaternion", divider=2),
        plan("/log/state/mode", "<i4", labels={0: "STAND", 1: "WALK"}),
        plan("/log/state/text", "|S5", divider=3),
        plan("/log/m", "<f4", kind="matrix"),
        plan("/log/c", kind="complex"),
        plan("/log/state/on", "|b1"),
    ]
    recording = recorded(plans, 10, frequency_hz=500.0)
    mode = recording.elements[2].entries[0].values
    mode[:] = [0, 0, 1, 1, 1, 7, 0, 0, 0, 0]
    write(recording, tmp_path, "robot", ["silo"], "run")
    return open_log("run.silo", tmp_path)


class TestLog:
    def test_it_maps_names_of_elements_to_signals_without_the_prefix_and_for_single_scalars_too(self, log):
        assert list(log)[:2] == ["/log/imu/acc", "/log/imu/q"]
        assert len(log) == 7
        assert log["/log/imu/acc"].values.shape == (10, 3)
        np.testing.assert_array_equal(log["imu/acc_y"].values, log["/log/imu/acc"].values[:, 1])
        assert "imu/acc_y" in log
        assert "imu/none" not in log
        offered = log._ipython_key_completions_()
        assert set(log) <= set(offered)
        assert {name.removeprefix("/log/") for name in log} <= set(offered)

    def test_an_unknown_name_suggests_others(self, log):
        with pytest.raises(UnknownSignalError, match=r"no signal '/log/imu/ac'; did you mean '/log/imu/acc"):
            log["/log/imu/ac"]
        assert log.get("none") is None

    def test_what_lacks_a_name_says_what_it_is_and_where_names_are_listed(self, log, tmp_path):
        for thing, what, listed in (
            (log, "a log", "silo.Log"),
            (log["imu/acc"], "a signal", "silo.Signal"),
            (log.recording, "a recording", "silo.Recording"),
            (silo.ElementOptions(), "options", "silo.ElementOptions"),
            (silo.compare(log, log), "a comparison", "silo.types.Comparison"),
            (silo.runs(tmp_path), "a list of runs", "silo.run_index.runs.RunList"),
        ):
            with pytest.raises(UnknownNameError) as refused:
                _ = thing.qqq
            assert str(refused.value) == f"{what} has no 'qqq': help({listed}) lists what there is"

    def test_options_of_a_logger_say_what_their_names_are(self, new_logger):
        options = new_logger().options
        for name, words in (
            ("path", "it is .folder"), ("rate", "it is .frequency_hz"), ("duration", "it is .max_time_s"),
        ):  # fmt: skip
            with pytest.raises(UnknownNameError) as refused:
                getattr(options, name)
            assert str(refused.value) == f"options has no '{name}': {words}"

    def test_patterns_and_namespaces(self, log):
        assert log.names("*/state/*") == ["/log/state/mode", "/log/state/text", "/log/state/on"]
        assert log.names("imu/*") == ["/log/imu/acc", "/log/imu/q"]
        assert [each.name for each in log.glob("*mod?")] == ["/log/state/mode"]
        assert list(log.namespace("/log/imu")) == list(log.namespace("imu")) == ["/log/imu/acc", "/log/imu/q"]

    def test_elements_have_shape_unit_description_and_times_as_they_were_logged(self, log):
        assert log["imu/q"].values.shape == (5, 4)
        assert log["m"].values.shape == (10, 2, 3)
        assert log["c"].values.dtype == np.complex128
        assert log["state/text"].values.dtype.kind == "U"
        assert log["m"].component("1_2").values.shape == (10,)
        acceleration = log["imu/acc"]
        assert (acceleration.unit, acceleration.description) == ("m/s²", "of the base")
        assert (log["imu/q"].divider, log["imu/q"].kind) == (2, "quaternion")
        np.testing.assert_allclose(log["imu/q"].times, [0, 0.004, 0.008, 0.012, 0.016])
        assert log["imu/q"].time_ns[1] - log.start_ns == 4_000_000
        assert log.duration_s == pytest.approx(0.018)
        assert log["state/mode"].texts.tolist()[:6] == ["STAND", "STAND", "WALK", "WALK", "WALK", "7"]

    def test_a_damaged_file_warns_when_it_is_opened(self, log, tmp_path):
        data = (tmp_path / "run.silo").read_bytes()
        (tmp_path / "cut.silo").write_bytes(data[:-1])
        with pytest.warns(LogWarning, match=r"cut\.silo: the file is cut off: 1 bytes are missing"):
            cut = open_log("cut.silo", tmp_path)
        assert "state/mode" in cut

    def test_opening_reads_no_values(self, log):
        again = read_silo(log.path)
        assert not any("values" in vars(entry) for element in again.elements for entry in element.entries)
        assert "time_ns" not in vars(again)

    def test_files_of_the_original_without_ending_open(self, fixtures_folder):
        assert open_log(fixtures_folder / "testData")["A"].value(7.0) == 256.0

    def test_elements_of_the_same_name_are_told_apart(self, plan, recorded):
        recording = recorded([plan("/log/a"), plan("/log/a")], 3)
        assert list(Log(recording)) == ["/log/a", "/log/a#2"]

    def test_an_empty_log_is_a_log(self):
        empty = Log(Recording("robot", np.empty(0, np.int64), 0, ()))
        assert (len(empty), empty.duration_s, empty.start_ns) == (0, 0.0, 0)


class TestValues:
    def test_the_value_is_the_one_that_held(self):
        steps = signal([1.0, 2.0, 3.0])
        assert [steps.value(time) for time in (0.0, 0.49, 0.5, 0.99, 1.0, 99.0)] == [1, 1, 2, 2, 3, 3]
        np.testing.assert_array_equal(steps.value([0.2, 0.7]), [1, 2])

    def test_before_the_first_sample_there_is_no_value(self):
        with pytest.raises(ElementError, match=r"'s' has no value yet at 0.1 s; it has samples from 1 to 1.5 s"):
            signal([1.0, 2.0], start_s=1.0).value(0.1)

    def test_clip_keeps_both_ends_and_the_clock(self):
        clipped = signal(np.arange(6)).clip(0.5, 2.0)
        assert clipped.values.tolist() == [1, 2, 3, 4]
        assert clipped.times.tolist() == [0.5, 1.0, 1.5, 2.0]
        assert len(signal([1, 2]).clip(5)) == 0

    def test_resample_holds_or_interpolates(self):
        ramp = signal([0.0, 1.0, 2.0])
        assert ramp.resample([0.25, 0.75, 1.5]).values.tolist() == [0, 1, 2]
        assert ramp.resample([-1, 0.25, 0.75, 1.5], "linear").values.tolist() == [0.5, 1.5]
        assert ramp.resample(4.0, "linear").values.tolist() == [0, 0.5, 1, 1.5, 2]
        assert ramp.resample(signal([0, 0], step_s=0.6)).values.tolist() == [0, 1]

    @pytest.mark.parametrize("kind", ["quaternion", "pose"])
    def test_turns_go_the_shortest_way_whatever_their_sign(self, kind):
        angles = np.arange(10) * 0.3
        turns = np.stack([0 * angles, 0 * angles, np.sin(angles / 2), np.cos(angles / 2)], axis=-1)
        turns[::2] *= -1
        places = np.repeat(np.arange(10.0)[:, None], 3, axis=1)
        given = turns if kind == "quaternion" else np.concatenate([places, turns], axis=1)
        steps = np.array([0, 0.7, 2.25, 8.9, 9])
        made = replace(signal(given), kind=kind).resample(steps * 0.5, "linear").values
        truth = np.sin(steps * 0.15)
        assert np.abs(made[:, -2]) == pytest.approx(truth, abs=1e-12)
        assert np.linalg.norm(made[:, -4:], axis=1) == pytest.approx(1, abs=1e-12)
        assert made[[0, -1], -4:].tolist() == turns[[0, -1]].tolist()
        if kind == "pose":
            assert made[:, 1] == pytest.approx(steps)

    def test_a_turn_that_is_none_is_nan_between_its_neighbours_alone(self):
        turns = np.array([[0, 0, 0, 1], [np.nan] * 4, [0, 0, 0, 1], [0, 0, 1, 0.0]])
        made = replace(signal(turns), kind="quaternion").resample([0, 0.25, 0.75, 1, 1.25, 1.5], "linear").values
        assert np.isnan(made).all(axis=1).tolist() == [False, True, True, False, False, False]
        assert made[4] == pytest.approx([0, 0, 0.5**0.5, 0.5**0.5])

    @pytest.mark.parametrize("values", [[False, True, False], [0, 2, 0], np.array([0, 200, 0], np.uint8)])
    def test_states_hold_as_those_of_a_log_do(self, values):
        states = replace(signal(values), labels={0: "A", 2: "C"})
        made = states.resample([0.25, 0.5, 0.75], "linear")
        assert (made.values.tolist(), made.dtype) == ([values[0], values[1], values[1]], states.dtype)
        assert made.labels == states.labels

    def test_resample_refuses_what_it_can_not_do(self):
        with pytest.raises(ElementError, match="choose 'hold' or 'linear'"):
            signal([1.0]).resample(1.0, "cubic")
        with pytest.raises(ElementError, match="rate must be more than 0"):
            signal([1.0]).resample(0.0)
        with pytest.raises(ElementError, match="are no numbers"):
            signal(["a", "b"]).resample(1.0, "linear")

    def test_an_unknown_component_names_the_known(self):
        with pytest.raises(ElementError, match="no component 'q'; it has: x, y, z"):
            signal(np.zeros((2, 3))).component("q")


class TestStatistics:
    def test_of_a_window_without_nan_and_exact(self):
        wave = signal([1.0, 2.0, 3.0, 10.0])
        assert wave.mean(0, 1.0) == 2.0
        assert wave.rms(0.5, 1.0) == pytest.approx(np.sqrt(6.5))
        assert wave.std(0, 1.0) == pytest.approx(np.std([1, 2, 3]))
        assert (wave.min(), wave.max(), wave.max(0, 1.0)) == (1, 10, 3)
        holes = signal([[1.0, np.nan], [3.0, np.nan]])
        assert repr(holes.mean().tolist()) == "[2.0, nan]"
        assert repr(holes.max().tolist()) == "[3.0, nan]"
        assert signal(np.array([2**63 - 1, 5], np.int64)).max() == 2**63 - 1

    def test_an_empty_window_is_an_error_with_the_span_and_strings_have_none(self):
        with pytest.raises(ElementError, match=r"no sample from 7 s to its end; it has samples from 0 to 0.5 s"):
            signal([1.0, 2.0]).mean(7)
        with pytest.raises(ElementError, match="no numbers"):
            signal(["a"]).mean()


class TestCalculus:
    def test_the_derivative_of_a_ramp_is_its_slope(self):
        ramp = signal(np.arange(5) * 3.0, unit="rad").derivative()
        np.testing.assert_allclose(ramp.values, 6.0)
        assert ramp.unit == "rad/s"

    def test_the_integral_undoes_the_derivative(self):
        wave = signal(np.sin(np.arange(2000) * 0.01), step_s=0.01)
        np.testing.assert_allclose(wave.derivative().integral().values, wave.values - wave.values[0], atol=1e-4)

    def test_the_spectrum_shows_frequency_and_amplitude(self):
        times = np.arange(2000) * 0.01
        frequencies, amplitudes = signal(3 * np.sin(2 * np.pi * 5 * times), step_s=0.01).spectrum()
        assert frequencies[amplitudes.argmax()] == pytest.approx(5, abs=0.05)
        assert amplitudes.max() == pytest.approx(3, rel=0.02)

    def test_vectors_go_component_by_component(self):
        both = signal(np.stack([np.arange(8.0), -np.arange(8.0)], axis=1))
        np.testing.assert_allclose(both.derivative().values, [[2, -2]] * 8)
        assert both.spectrum()[1].shape == (5, 2)
        np.testing.assert_allclose(signal([[3.0, 4.0]]).norm().values, [5])


class TestArithmetic:
    def test_with_numbers_on_both_sides(self):
        numbers = signal([1.0, 2.0])
        assert (2 * numbers + 1 - numbers / 2).values.tolist() == [2.5, 4.0]
        assert (1 / numbers).values.tolist() == [1, 0.5]
        assert (numbers / 0).values.tolist() == [np.inf] * 2
        assert (-numbers).values.tolist() == [-1, -2]
        assert (np.array([1.0, 1.0]) - numbers).values.tolist() == [0, -1]
        assert abs(numbers**2 - 5).values.tolist() == [4, 1]

    def test_signals_meet_on_the_stamps_of_the_faster_one(self):
        fast, slow = signal(np.arange(6.0)), signal([10.0, 20.0], step_s=1.0, start_s=0.5)
        for made, expected in ((fast + slow, [11, 12, 23, 24]), (slow - fast, [9, 8, 17, 16])):
            assert made.values.tolist() == expected
            # at 2.5 s the next one of the slow signal would have come
            assert made.times.tolist() == [0.5, 1.0, 1.5, 2.0]

    def test_small_integers_do_not_wrap_around(self):
        assert (signal(np.array([0, 250], np.uint8)) - 5).values.tolist() == [-5, 245]
        assert (signal(np.array([True, False])) + signal(np.array([True, True]))).values.tolist() == [2, 1]

    def test_a_scalar_meets_every_component(self):
        made = signal([[1.0, 2.0], [3.0, 4.0]]) * signal([10.0, 100.0])
        assert made.values.tolist() == [[10, 20], [300, 400]]
        assert (signal([10.0, 100.0]) * signal([[1.0, 2.0], [3.0, 4.0]])).components == ("x", "y")

    def test_shapes_that_do_not_meet_are_told(self):
        stamps = np.arange(4) * 10**9
        vector, matrix = Signal("/v", np.zeros((4, 3)), stamps), Signal("/m", np.zeros((4, 2, 3)), stamps)
        with pytest.raises(ElementError, match=r"'/v' \+ '/m': one sample has shape \(3,\) and \(2, 3\)"):
            vector + matrix

    def test_units_follow(self):
        torque, speed = signal([1.0], unit="Nm"), signal([2.0], unit="rad/s")
        assert (torque * speed).unit == "W"
        assert ((torque / torque).unit, (torque + torque).unit) == ("-", "Nm")
        with pytest.raises(ElementError, match=r"the unit of one is 'Nm', of the other 'rad/s'"):
            torque + speed


class TestFrames:
    @pytest.fixture(autouse=True)
    def scipy(self):
        pytest.importorskip("scipy")

    def test_a_vector_turns_with_a_quaternion_and_back(self):
        quarter = signal([[0, 0, np.sqrt(0.5), np.sqrt(0.5)]] * 2, step_s=1.0)
        forward = signal([[1.0, 0, 0]] * 4)
        turned = forward.rotate(quarter)
        np.testing.assert_allclose(turned.values, [[0, 1, 0]] * 4, atol=1e-12)
        np.testing.assert_allclose(turned.rotate(quarter, inverse=True).values, forward.values, atol=1e-12)
        np.testing.assert_allclose(turned.rotate(quarter.inverse()).values, forward.values, atol=1e-12)

    def test_euler_angles_in_degrees_are_read_as_such(self):
        turns = signal([[0, 0, np.sin(0.3), np.cos(0.3)]])
        degrees = turns.euler(degrees=True)
        assert degrees.quaternion().values[0] == pytest.approx(turns.values[0])
        assert degrees.with_unit("-").quaternion(degrees=True).values[0] == pytest.approx(turns.values[0])
        assert turns.euler().with_unit("deg").quaternion(degrees=False).values[0] == pytest.approx(turns.values[0])

    def test_euler_angles_and_back(self):
        angles = signal([[0.3, 0.2, 0.1]])
        again = angles.quaternion("ZYX").euler("ZYX")
        np.testing.assert_allclose(again.values, angles.values)
        assert (again.unit, again.components) == ("rad", ("0_z", "1_y", "2_x"))

    def test_angle_axis_and_matrices_become_quaternions(self):
        expected = [[0, 0, np.sqrt(0.5), np.sqrt(0.5)]]
        axis = signal([[np.pi / 2, 0, 0, 2.0]], kind="angle_axis")
        matrix = signal(np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]]), kind="matrix")
        np.testing.assert_allclose(axis.quaternion().values, expected, atol=1e-12)
        np.testing.assert_allclose(matrix.quaternion().values, expected, atol=1e-12)

    def test_the_axis_of_an_angle_has_any_direction_and_length_and_one_without_length_turns_nothing(self):
        axes = [*0.5 * np.eye(3), np.zeros(3)]
        turned = signal([[np.pi / 2, *axis] for axis in axes], kind="angle_axis").quaternion()
        half = np.sqrt(0.5)
        np.testing.assert_allclose(
            turned.values, [[half, 0, 0, half], [0, half, 0, half], [0, 0, half, half], [0, 0, 0, 1]], atol=1e-12
        )

    def test_what_is_no_rotation_becomes_nan_alone(self):
        broken = signal([[0, 0, 0, 1.0], [0, 0, 0, 0], [np.nan, 0, 0, 1]])
        assert np.isnan(broken.euler().values).all(axis=1).tolist() == [False, True, True]

    def test_wrong_shapes_and_orders_are_told(self):
        with pytest.raises(ElementError, match="'s' is not a quaternion: one sample has shape"):
            signal([1.0]).euler()
        with pytest.raises(ElementError, match="no order of Euler angles: 'XXY'"):
            signal([[0, 0, 0, 1.0]]).euler("XXY")

    def test_a_pose_has_a_position_and_an_orientation(self):
        names = ("position_x", "position_y", "position_z", *(f"orientation_{axis}" for axis in "xyzw"))
        pose = signal([[1, 2, 3, 0, 0, 0, 1.0]], kind="pose", components=names)
        assert pose.part("position").values.tolist() == [[1, 2, 3]]
        assert pose.part("orientation").euler().values.tolist() == [[0, 0, 0]]


class TestTables:
    def test_pandas_gets_times_labels_and_components(self, log):
        pytest.importorskip("pandas")
        mode = log["state/mode"].to_pandas()
        assert mode.tolist()[:3] == ["STAND", "STAND", "WALK"]
        assert mode.index.astype("int64").tolist() == log.time_ns.tolist()
        assert list(log["imu/acc"].to_pandas().columns) == [f"/log/imu/acc_{axis}" for axis in "xyz"]

    def test_a_log_becomes_one_table_with_gaps(self, log):
        pytest.importorskip("pandas")
        frame = log.to_pandas()
        assert len(frame) == 10
        assert frame["/log/imu/q_x"].isna().tolist()[1::2] == [True] * 5
        np.testing.assert_array_equal(frame["/log/imu/q_x"].to_numpy()[::2], log["imu/q_x"].values)
        assert frame["/log/state/text"].notna().tolist() == [tick % 3 == 0 for tick in range(10)]

    def test_integers_with_gaps_stay_integers(self, plan, recorded):
        pytest.importorskip("pandas")
        recording = recorded([plan("/log/a", "<i8", divider=2, buffer_type=BufferType.GROWING)], 4)
        frame = Log(recording).to_pandas()
        assert frame["/log/a"].dropna().tolist() == recording.elements[0].entries[0].values.tolist()

    def test_polars_has_nulls_where_there_is_no_sample(self, log):
        pytest.importorskip("polars")
        frame = log.to_polars()
        assert frame.height == 10
        assert frame["/log/state/text"].is_null().to_list() == [tick % 3 != 0 for tick in range(10)]
        assert frame["/log/state/mode"].cast(str).to_list()[2] == "WALK"
        assert log["imu/acc"].to_polars().columns == ["time", *(f"/log/imu/acc_{axis}" for axis in "xyz")]

    @pytest.mark.parametrize("kind", ["U4", "S4", "i4"])
    def test_polars_has_types_without_samples_too(self, kind):
        pytest.importorskip("polars")
        none, two = (signal(np.zeros(count, kind)).to_polars()["s"].dtype for count in (0, 2))
        assert none == two

    def test_xarray_has_units_and_dimensions(self, log):
        pytest.importorskip("xarray")
        acceleration = log["imu/acc"].to_xarray()
        assert acceleration.dims == ("time", "component")
        np.testing.assert_array_equal(acceleration.sel(component="y").values, log["imu/acc_y"].values)
        assert acceleration.attrs["units"] == "m/s²"
        assert log["state/mode"].to_xarray().attrs["flag_meanings"] == "STAND WALK"
        assert log.to_xarray().sizes["/log/imu/q.time"] == 5

    @pytest.mark.parametrize("kind", ["M8[ns]", "m8[ns]"])
    def test_dates_in_xarray_are_fit_for_netcdf(self, kind):
        xarray = pytest.importorskip("xarray")
        array = signal(np.array([3, 5, 9]).astype(kind)).to_xarray()
        encoded, _ = xarray.conventions.cf_encoder({"s": array.variable}, {})
        assert encoded["s"].attrs["units"].startswith("nanoseconds")

    def test_numpy_takes_a_signal(self, log):
        assert np.asarray(log["state/mode"]).tolist() == log["state/mode"].to_numpy().tolist()
        assert np.asarray(log["state/mode"]).base is not None


class TestNamesThatAreMeant:
    @pytest.fixture
    def log(self, plan, recorded):
        names = ("/log/joints/q", "/log/joints/qd", "/log/base/pose", "/log/mode")
        return Log(recorded([plan(name) for name in names], 10))

    @pytest.mark.parametrize("ask", ["names", "glob", "to_pandas", "to_polars", "to_xarray"])
    def test_nothing_found_is_told_with_names_alike(self, log, ask):
        with pytest.warns(LogWarning, match=r"no signal that 'jonts/q' means; did you mean .*'/log/joints/q"):
            getattr(log, ask)("jonts/q")


def test_arrays_hold_logs_as_any_object_and_equal_none(new_logger):
    logger = new_logger()
    logger.array("x")
    logger.start()
    logger.collect()
    log, array = silo.Log(logger.snapshot()), np.arange(3)
    held = np.array([log, log], dtype=object)
    assert held.shape == (2,)
    assert all(one is log for one in held)
    assert (log == array, array == log, log != array, array != log, log in [array]) == (False, False, True, True, False)
    for wrong in (lambda: np.array([log]), lambda: np.asarray(log, float), lambda: np.sin(log), lambda: array - log):
        with pytest.raises(silo.errors.ArgumentError, match=r"a log is no array: log.to_pandas"):
            wrong()


@given(st.lists(st.integers(-(2**63), 2**63 - 1)))
def test_distinct_stamps_are_those_of_a_set_in_their_order(stamps):
    assert distinct(np.array(stamps, np.int64)).tolist() == sorted(set(stamps))


def test_no_set_is_made_of_the_stamps_of_a_log(log, monkeypatch):
    as_set = np.unique

    def sorting(values, **options):
        assert options or np.size(values) < 4, (
            "of a million stamps NumPy takes 2 s to make a set, and 20 ms to sort them"
        )
        return as_set(values, **options)

    monkeypatch.setattr(np, "unique", sorting)
    own = replace(log.recording.elements[0], own_ns=log.time_ns + 5)
    of_two = Log(replace(log.recording, elements=(own, *log.recording.elements[1:])))
    for one in (log.resample(1000), log.resample([0.004, 0.0, 0.002, 0.008, 0.004, 0.01]), of_two.resample(1000)):
        assert len(one.to_pandas()) == len(one.time_ns) > 3
    assert len(of_two.to_pandas()) == 2 * len(of_two.time_ns)
