"""Signals of different logs meet on the time since the start of theirs; signals with no time in common don't meet."""

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.analysis.signal import Signal
from silo.core.recording import Recording
from silo.errors import ElementError

DAY_NS = 86_400 * 10**9


def signal(values, step_s=0.5, start_s=0.0, log_start_ns=10**18, name="s", **more):
    values = np.asarray(values)
    time_ns = log_start_ns + np.round((start_s + np.arange(len(values)) * step_s) * 1e9).astype(np.int64)
    return Signal(name, values, time_ns, start_ns=log_start_ns, **more)


def run(log_start_ns, values, **more):
    return signal(values, log_start_ns=log_start_ns, **more)


class TestTwoRuns:
    def test_their_difference_is_taken_at_the_same_time_since_start(self):
        monday, tuesday = run(10**18, [1.0, 2.0, 3.0]), run(10**18 + DAY_NS, [10.0, 20.0, 30.0])
        difference = tuesday - monday
        assert difference.values.tolist() == [9, 18, 27]
        assert difference.times.tolist() == [0, 0.5, 1]
        assert difference.start_ns == tuesday.start_ns
        assert (monday - tuesday).time_ns.tolist() == monday.time_ns.tolist()

    def test_one_is_resampled_on_the_other(self):
        monday, tuesday = run(10**18, [1.0, 2.0, 3.0]), run(10**18 + DAY_NS, [10.0, 20.0, 30.0, 40.0], step_s=0.3)
        held = tuesday.resample(monday)
        assert held.values.tolist() == [10, 20, 40]
        assert held.time_ns.tolist() == monday.time_ns.tolist()
        assert (monday - held).values.tolist() == [-9, -18, -37]
        assert (held - monday).values.tolist() == [9, 18, 37]

    def test_one_is_interpolated_on_the_other(self):
        monday, tuesday = run(10**18, [0.0, 1.0]), run(10**18 + DAY_NS, [0.0, 10.0], step_s=1.0)
        assert tuesday.resample(monday, "linear").values.tolist() == [0, 5]

    def test_an_element_that_began_later_keeps_its_delay(self):
        monday, tuesday = run(10**18, [1.0, 2.0, 3.0]), run(10**18 + DAY_NS, [10.0, 20.0], start_s=0.5)
        assert (monday + tuesday).times.tolist() == [0.5, 1.0]
        assert (monday + tuesday).values.tolist() == [12, 23]

    def test_a_scalar_of_one_meets_a_vector_of_the_other_at_the_start_of_the_left_one(self):
        monday = run(10**18, [1.0, 2.0])
        tuesday = run(10**18 + DAY_NS, [[1.0, 2.0], [3.0, 4.0]], components=("x", "y"))
        assert (monday * tuesday).values.tolist() == [[1, 2], [6, 8]]
        assert (monday * tuesday).times.tolist() == [0, 0.5]
        assert (monday * tuesday).start_ns == monday.start_ns
        assert (monday * tuesday).components == ("x", "y")

    def test_a_vector_of_one_turns_with_the_orientation_of_the_other(self):
        pytest.importorskip("scipy")
        vector = run(10**18, [[1.0, 0, 0]] * 3, components=("x", "y", "z"))
        turn = run(10**18 + DAY_NS, [[0, 0, 1.0, 0]] * 3, kind="quaternion", components=("x", "y", "z", "w"))
        np.testing.assert_allclose(vector.rotate(turn).values, [[-1, 0, 0]] * 3, atol=1e-12)

    def test_logs_that_were_opened_from_files_meet(self, plan, recorded):
        one, other = (Log(recorded([plan("/log/rew")], 10, frequency_hz=500.0)) for _ in range(2))
        later = Log(
            Recording(
                other.recording.logger,
                other.recording.time_ns + DAY_NS,
                other.recording.started_ns + DAY_NS,
                other.recording.elements,
            )
        )
        assert len(one["rew"] - later["rew"]) == 10

    def test_loggers_that_ran_at_once_meet_on_their_stamps_when_asked(self):
        arm, base = run(10**18, [1.0, 2.0, 3.0]), run(10**18 + 5 * 10**8, [10.0, 20.0])
        assert (arm + base).values.tolist() == [11, 22]  # base has none at 1 s
        assert (arm + base.counted_from(arm)).values.tolist() == [12, 23]
        assert base.counted_from(arm).times.tolist() == [0.5, 1.0]
        assert base.counted_from(10**18).times.tolist() == [0.5, 1.0]


class TestNothingInCommon:
    SPANS = r"'a' has samples from 0 to 1 s, 'b' has samples from 3 to 4 s"

    @pytest.mark.parametrize("other_start_ns", [10**18, 10**18 + DAY_NS])
    def test_a_calculation_is_an_error_that_says_both_spans(self, other_start_ns):
        a = signal([1.0, 2.0, 3.0], name="a")
        b = signal([1.0, 2.0, 3.0], start_s=3.0, log_start_ns=other_start_ns, name="b")
        with pytest.raises(ElementError, match=rf"can't calculate 'a' - 'b': .*no time in common.*{self.SPANS}"):
            a - b
        with pytest.raises(
            ElementError, match=r"no time in common.*'b' has samples from 3 to 4 s, 'a' has samples from 0 to 1 s"
        ):
            b - a

    @pytest.mark.parametrize("method", ["hold", "linear"])
    def test_resampling_is_an_error_that_says_both_spans(self, method):
        a, b = signal([1.0, 2.0, 3.0], name="a"), signal([1.0, 2.0, 3.0], start_s=3.0, name="b")
        with pytest.raises(
            ElementError, match=r"can't resample 'b' .*'b' has samples from 3 to 4 s, 'a' has samples from 0 to 1"
        ):
            b.resample(a, method)

    def test_a_rotation_is_an_error_that_says_both_spans(self):
        pytest.importorskip("scipy")
        vector = signal([[1.0, 0, 0]] * 3, name="a", components=("x", "y", "z"))
        turn = signal([[0, 0, 0, 1.0]] * 3, start_s=3.0, name="b", components=("x", "y", "z", "w"))
        with pytest.raises(ElementError, match=rf"can't rotate 'a' by 'b': .*{self.SPANS}"):
            vector.rotate(turn)

    def test_times_before_the_first_sample_alone_are_an_error_too(self):
        with pytest.raises(ElementError, match=r"'b' has samples from 3 to 4 s.*asked for are from 0 to 1 s"):
            signal([1.0, 2.0, 3.0], start_s=3.0, name="b").resample([0.0, 1.0])

    def test_a_signal_without_samples_has_nothing_in_common(self):
        a, empty = signal([1.0, 2.0, 3.0], name="a"), signal([], name="b")
        with pytest.raises(ElementError, match=r"'a' has samples from 0 to 1 s, 'b' has no sample"):
            a - empty
        with pytest.raises(ElementError, match="'b' has no sample"):
            empty.resample(a)
        assert len(empty + empty) == 0
        assert len(empty.resample(2.0)) == 0
        assert len(a.resample(empty)) == 0

    def test_the_last_value_of_a_slow_signal_holds_until_its_next_would_come(self):
        fast, slow = signal([1.0, 2.0], start_s=2.5), signal([10.0, 20.0], step_s=2.0)
        assert (fast + slow).values.tolist() == [21, 22]

    def test_a_single_sample_holds_on(self):
        assert (signal([1.0, 2.0], start_s=7.0) + signal([10.0])).values.tolist() == [11, 12]
