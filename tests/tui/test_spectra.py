"""Spectra with their peaks, one signal over another, histograms: what the large plot computes and draws."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.analysis.compute.spectra import Peak, Spectrum, lines_of, longest_piece, peaks_of, spectrum_of
from silo.analysis.log import Log
from silo.analysis.plots.charts import ChartSpec, make_chart
from silo.analysis.signal import Signal
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import LogWarning
from silo_tui.model.drawing import big_plot
from silo_tui.model.drawing.big_plot import histogram_of, pair_of
from silo_tui.model.drawing.dots import BLANK

HZ = 400
PERIOD_NS = 2_500_000
SIZE = (60, 16)


def times(count):
    return np.arange(count, dtype=np.int64) * PERIOD_NS


def waves(count, *parts):
    seconds = np.arange(count) / HZ
    return sum(size * np.sin(2 * math.pi * hz * seconds) for hz, size in parts)


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_two_waves_are_two_peaks_with_their_frequencies_and_amplitudes(size):
    piece = longest_piece(times(4000), waves(4000, (12.53, size), (40.0, size / 4)))
    peaks = peaks_of(spectrum_of(piece))
    assert [peak.frequency_hz for peak in peaks] == pytest.approx([12.53, 40.0], abs=0.02)
    assert [peak.amplitude / size for peak in peaks] == pytest.approx([1, 0.25], rel=0.02)


def test_noise_and_constants_have_no_peaks():
    assert peaks_of(spectrum_of(longest_piece(times(256), np.full(256, 3.0)))) == []
    noise = np.random.default_rng(1).normal(size=4096)
    assert len(peaks_of(spectrum_of(longest_piece(times(4096), noise)))) <= 3


def test_what_rounding_leaves_of_a_constant_is_no_peak():
    values = np.full(1000, 0.1) + 1e-17 * np.arange(1000)
    values[::7] = np.nextafter(0.1, 1)
    assert spectrum_of(longest_piece(times(1000), values)).amplitudes.max() > 0
    assert peaks_of(spectrum_of(longest_piece(times(1000), values))) == []


def test_waves_that_a_short_time_hardly_tells_apart_are_peaks_where_there_is_a_dip_between_them():
    short = longest_piece(times(600), waves(600, (4.0, 1.0), (6.0, 0.3), (8.0, 0.2)))  # lines 6, 9 and 12 of 0.67 Hz
    assert [round(peak.frequency_hz) for peak in peaks_of(spectrum_of(short))] == [4, 6, 8]
    one = longest_piece(times(600), waves(600, (4.0, 1.0), (4.6, 0.9)))  # next to each other there is one hump
    assert len(peaks_of(spectrum_of(one))) == 1


def test_too_few_samples_say_how_many_are_needed():
    with pytest.raises(ValueError, match="12 held, 64 needed"):
        spectrum_of(longest_piece(times(12), np.zeros(12)))
    with pytest.raises(ValueError, match="0 held, 64 needed"):
        spectrum_of(longest_piece(times(0), np.zeros(0)))


def test_the_longest_piece_has_neither_hole_nor_nan():
    time_ns, values = times(1000), np.arange(1000.0)
    time_ns[300:] += 50 * PERIOD_NS
    values[800] = math.nan
    piece = longest_piece(time_ns, values)
    assert piece.values.tolist() == list(range(300, 800))
    assert (piece.held, round(1 / piece.period_s)) == (1000, HZ)


@pytest.mark.parametrize(
    ("missing", "kept"), [([60], range(60)), ([40, 80], [*range(40), *range(41, 80), *range(81, 100)])]
)
def test_samples_that_are_missing_are_bridged_where_less_than_half_would_be_left(missing, kept):
    values = np.arange(100.0)
    values[missing] = math.nan
    found = longest_piece(times(100), values).values
    assert (len(found), found[0], found[-1]) == (len(kept), kept[0], kept[-1])


def test_a_stamp_that_comes_twice_is_a_hole():
    time_ns = times(100)
    time_ns[50:] -= PERIOD_NS
    assert longest_piece(time_ns, np.arange(100.0)).values.tolist() == list(range(50, 100))


def test_a_late_loop_is_no_hole_but_jitter():
    late = times(2000)
    late[1::2] += PERIOD_NS // 2
    seconds = late / 1e9
    piece = longest_piece(late, np.sin(2 * math.pi * 10 * seconds))
    assert len(piece.values) == 2000
    assert piece.jitter_s == pytest.approx(PERIOD_NS / 2 / 1e9, rel=0.01)
    assert peaks_of(spectrum_of(piece))[0].frequency_hz == pytest.approx(10, abs=0.05)


def test_a_loop_that_a_busy_computer_holds_up_has_a_spectrum_of_what_comes_in_bursts():
    late = times(1600).reshape(-1, 4)  # four samples at their time, none for as long as 32, a second of none
    late = (late + 32 * PERIOD_NS * np.arange(len(late))[:, None]).reshape(-1)
    late[200:] += 10**9
    piece = longest_piece(late, np.sin(2 * math.pi * 1.8 * late / 1e9))
    assert len(piece.values) == 1400
    assert peaks_of(spectrum_of(piece))[0].frequency_hz == pytest.approx(1.8, abs=0.05)
    few = np.r_[late[:40], late[:40] + 10**12]
    with pytest.raises(ValueError, match="longest whole piece: 40 of 80 samples, 64 needed"):
        spectrum_of(longest_piece(few, np.zeros(80)))


def with_hole(begin, end, count=1600, hz=20.0):
    """A sine of amplitude 1 at 400 Hz whose samples from `begin` to `end` are missing."""
    kept = np.r_[0:begin, end:count]
    return times(count)[kept], np.sin(2 * math.pi * hz * kept / HZ)


def test_a_loop_that_catches_up_in_bursts_has_no_holes_between_them():
    """As on a busy computer: most steps are next to nothing, and each longer one was taken for a hole."""
    stamps = np.concatenate([at * 20_000_000 + np.arange(8) * 100_000 for at in range(500)])
    piece = longest_piece(stamps, np.sin(2 * math.pi * 5 * stamps / 1e9))
    assert len(piece.values) == 4000
    assert peaks_of(spectrum_of(piece))[0].frequency_hz == pytest.approx(5, abs=0.05)


@pytest.mark.parametrize(("begin", "end"), [(800, 804), (800, 808), (700, 720), (600, 1000), (100, 1500), (1590, 1596)])
def test_a_hole_lowers_no_amplitude_wherever_a_spectrum_is_shown(begin, end):
    time_ns, values = with_hole(begin, end)
    by_screen = peaks_of(spectrum_of(longest_piece(time_ns, values)))[0]
    assert (by_screen.frequency_hz, by_screen.amplitude) == pytest.approx((20, 1), rel=0.02)
    signal = Signal("s", values, time_ns)
    with pytest.warns(LogWarning, match=f"longest whole piece: [0-9]+ of {len(values)} samples"):
        frequencies, amplitudes = signal.spectrum()
    # between two lines an amplitude is up to 15 % lower: of the same lines it is the same
    np.testing.assert_allclose(amplitudes[1:], spectrum_of(longest_piece(time_ns, values)).amplitudes)
    assert frequencies[amplitudes.argmax()] == pytest.approx(20, abs=2)
    entry = RecordedEntry("/log/s", Entry("", "<f8"), values)
    recording = Recording(
        "r",
        time_ns,
        0,
        (RecordedElement("/log/s", "-", "scalar", (), 1, BufferType.GROWING, 0, (entry,), own_ns=time_ns),),
    )
    chart, _ = make_chart(Log(recording).recording, ChartSpec(["s"], transform="spectrum"))
    np.testing.assert_allclose(chart.curves[0].y, amplitudes)
    assert "longest whole piece" in chart.curves[0].label


def test_samples_that_are_missing_all_over_are_bridged():
    values = waves(4000, (12.5, 1.0))
    values[::10] = math.nan
    piece = longest_piece(times(4000), values)
    assert len(piece.values) == 3600
    assert peaks_of(spectrum_of(piece))[0].amplitude == pytest.approx(1, rel=0.03)
    assert "3600 of 4000" in piece.left_out


@settings(deadline=None)
@given(st.floats(5, 190), st.integers(1000, 5000))
def test_a_sine_anywhere_between_two_lines_has_its_frequency_and_amplitude(hz, count):
    (peak, *_) = peaks_of(spectrum_of(longest_piece(times(count), waves(count, (hz, 3.0)))))
    assert (peak.frequency_hz, peak.amplitude) == (pytest.approx(hz, abs=0.01), pytest.approx(3, rel=0.002))


@pytest.mark.parametrize("count", [1000, 1001])
@pytest.mark.parametrize("line", [1.75, 2.25, 2.6, -2.6, -1.4])
def test_a_sine_near_the_ends_of_a_spectrum_has_its_frequency_and_amplitude(line, count):
    hz = (line if line > 0 else count / 2 + line) * HZ / count
    (peak, *_) = peaks_of(spectrum_of(longest_piece(times(count), waves(count, (hz, 3.0)))))
    assert peak.frequency_hz == pytest.approx(hz, abs=0.1 * HZ / count)
    assert peak.amplitude == pytest.approx(3, rel=0.03)


def test_the_highest_peak_is_the_first():
    piece = longest_piece(times(4000), waves(4000, (8.0, 0.02), (12.5, 1.1), (60.0, 0.3)))
    assert [round(peak.frequency_hz) for peak in peaks_of(spectrum_of(piece))] == [12, 60, 8]


def test_a_spectrum_without_a_hole_says_nothing_of_it(recwarn):
    Signal("s", waves(400, (20.0, 1.0)), times(400)).spectrum()
    assert not recwarn.list
    assert len(lines_of(longest_piece(times(8), np.arange(8.0)))[0]) == 5


@pytest.mark.parametrize("hz", [50.0, 51.3, 51.7, 52.5])
def test_the_axis_reaches_the_amplitude_that_is_told(hz):
    found = spectrum_of(longest_piece(times(160), waves(160, (hz, 41.0))))
    plot = big_plot.of_spectra([found], peaks_of(found), "linear", SIZE, None)
    assert peaks_of(found)[0].amplitude == pytest.approx(41, rel=0.05)
    assert max(float(word) for word in plot.left.values()) >= 40


@pytest.mark.parametrize(("chosen", "signs"), [(None, ["1", "3"]), (1, ["[2]", "3"])])
def test_a_number_that_has_no_room_beside_another_is_left_out(chosen, signs):
    found = spectrum_of(longest_piece(times(4000), waves(4000, (50.0, 2.0), (52.0, 2.0), (150.0, 0.2))))
    peaks = [Peak(50.0, 2.0), Peak(52.0, 2.0), Peak(150.0, 0.2)]
    plot = big_plot.of_spectra([found], peaks, "linear", SIZE, chosen)
    assert [sign for _, _, sign in plot.spots] == signs


def test_of_peaks_in_one_cell_the_highest_is_named_and_no_lower_one_in_its_place():
    waved = waves(4000, (50.0, 2.0), (54.5, 1.0), (56.0, 0.4), (150.0, 0.2))
    found = spectrum_of(longest_piece(times(4000), waved))
    peaks = [Peak(50.0, 2.0), Peak(54.5, 1.0), Peak(56.0, 0.4), Peak(150.0, 0.2)]
    cells = [big_plot.cell_of(peak.frequency_hz, found.top_hz, SIZE[0]) for peak in peaks]
    assert cells[1] == cells[0] + 1 == cells[2]
    plot = big_plot.of_spectra([found], peaks, "linear", SIZE, None)
    assert [(cell, sign) for _, cell, sign in plot.spots] == [(cells[0], "1"), (cells[1], "2"), (cells[3], "4")]
    assert plot.spots[0][0] < plot.spots[1][0], "at the height of its own"


@pytest.mark.parametrize("way", ["linear", "log", "dB"])
def test_the_number_of_a_low_peak_on_the_skirt_of_a_high_one_stands_at_its_own_height(way):
    amplitudes = np.full(200, 0.01)
    amplitudes[99:110] = 2.0  # beside the highest line, in the cell where the low peak is told
    cell_hz = 200 / SIZE[0]
    peaks = [Peak(100.0, 2.0), Peak(100.0 + 1.5 * cell_hz, 0.05)]
    plot = big_plot.of_spectra([Spectrum(amplitudes, 1.0)], peaks, way, SIZE, None)
    heights = {sign: line for line, _, sign in plot.spots}
    alone = big_plot.of_spectra([Spectrum(amplitudes, 1.0)], [peaks[0], Peak(180.0, 0.05)], way, SIZE, None)
    assert heights["2"] == {sign: line for line, _, sign in alone.spots}["2"] > heights["1"]


def test_the_log_axis_names_powers_of_ten():
    plot = big_plot.of_spectra([Spectrum(np.array([1.0, 1e-3, 0.1] * 30), 1.0)], [], "log", SIZE, None)
    assert set(plot.left.values()) == {"1e0", "1e-1", "1e-2", "1e-3"}


def test_a_circle_has_its_area_and_no_correlation():
    angle = np.linspace(0, 2 * math.pi, 1000, endpoint=False)
    found = pair_of(times(1000), 2 * np.cos(angle), times(1000), 3 * np.sin(angle))
    assert found.area == pytest.approx(6 * math.pi, rel=1e-3)
    assert found.correlation == pytest.approx(0, abs=1e-9)


def test_a_line_has_its_slope_whatever_the_rates():
    x = np.arange(100.0)
    found = pair_of(times(100), x, times(100)[::4], 5 - 2 * x[::4])
    assert (found.correlation, found.slope) == pytest.approx((-1, -2))


def test_what_ended_is_not_held_on_over_the_other():
    found = pair_of(times(50), np.arange(50.0), times(100), np.arange(100.0))
    assert (len(found.x), found.slope) == (50, pytest.approx(1))


def test_a_constant_has_no_correlation():
    found = pair_of(times(10), np.full(10, 1e12), times(10), np.arange(10.0))
    assert math.isnan(found.correlation)


def test_the_newest_sample_of_an_x_y_plot_stands_out_and_older_ones_fade():
    pair = pair_of(times(300), np.arange(300.0), times(300), np.arange(300.0))
    plot = big_plot.of_pair(pair, SIZE)
    assert "".join(plot.lines).count("●") == 1
    assert plot.lines[-1].strip()[0] == "·"
    assert "•" in "".join(plot.lines)


@settings(deadline=None)
@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=200), st.integers(1, 100))
def test_every_value_is_in_the_histogram_once(values, most):
    found = histogram_of(np.array(values), most)
    assert found.counts.sum() == len(values)
    assert len(found.counts) <= max(1, most)
    big_plot.of_histogram(found, SIZE)


def test_the_middle_of_a_histogram_about_zero_is_called_zero_and_a_small_value_itself():
    spread = np.linspace(-5.2, 5.201, 4000)
    assert big_plot.of_histogram(histogram_of(spread, 40), SIZE).below == [
        (pytest.approx(0.5 + 0.5 * value / 5.2, abs=1e-3), word)
        for value, word in ((-4, "-4"), (-2, "-2"), (0, "0"), (2, "2"), (4, "4"))
    ]
    assert big_plot.of_histogram(histogram_of(spread + 5.201, 40), SIZE).below[-1][1] == "10"
    assert big_plot.of_histogram(histogram_of(1e-3 + spread / 1e4, 40), SIZE).below[2:4] == [
        (pytest.approx(0.5, abs=1e-3), "0.0010"), (pytest.approx(0.692, abs=1e-3), "0.0012"),
    ]  # fmt: skip


def test_whole_numbers_have_a_step_each():
    found = histogram_of(np.array([3.0, 5.0, 5.0]), 40)
    assert (found.counts.tolist(), found.first, found.step) == ([1, 0, 2], 2.5, 1.0)


@pytest.mark.parametrize(
    ("values", "first", "step"),
    [
        ([0.5, 0.5], 0.475, 0.05), ([2.0**60] * 3, 0.95 * 2.0**60, 0.1 * 2.0**60), ([0.0, 5e-324], -0.5, 1.0),
        ([-1.7e308, 1.7e308], -1.785e308, 1.7e307),
    ],
)  # fmt: skip
def test_what_has_no_steps_between_its_ends_is_one_bar(values, first, step):
    found = histogram_of(np.array(values), 40)
    assert found.counts.tolist() == [len(values)]
    assert (found.first, found.step) == (pytest.approx(first), pytest.approx(step))


def test_a_bar_is_as_high_as_its_count_and_where_nothing_is_there_is_none():
    plot = big_plot.of_histogram(histogram_of(np.array([0.0, 0.0, 1.0, 3.0]), 40), (8, 5))
    assert [line.replace(BLANK, " ")[::2] for line in plot.lines][-1] == "⣿⣿ ⣿"
    assert [(plot.owners[:, cell] == 0).sum() for cell in (0, 2, 4, 6)] == [5, 3, 0, 3]
    assert (plot.left[0], plot.left[4]) == ("2.0", "0.0")
    assert plot.below == [(0.125, "0"), (0.375, "1"), (0.625, "2"), (0.875, "3")]  # bars are as wide as a number


@pytest.mark.parametrize(
    ("width", "cell", "hz", "amplitude"),
    [
        (4, 0, 0.5, 0.0), (4, 1, 1.0, 5.0), (4, 2, 2.5, 9.0), (4, 3, 3.5, 4.0),  # the strongest line of the cell
        (32, 21, 2.5, 9.0), (32, 31, 4.0, 0.5), (32, 30, 4.0, 0.5), (32, 0, 0.5, 0.0),  # else the nearest
    ],
)  # fmt: skip
def test_a_cursor_reads_the_strongest_line_of_its_cell_or_the_nearest(width, cell, hz, amplitude):
    spectrum = Spectrum(np.array([0.0, 5.0, 1.0, 2.0, 9.0, 3.0, 4.0, 0.5]), 0.5)  # lines at 0.5 ... 4 Hz
    assert big_plot.line_in(spectrum, [], cell, 4.0, width) == Peak(hz, amplitude)


def test_a_cursor_reads_the_highest_peak_that_is_drawn_in_its_cell():
    spectrum = Spectrum(np.ones(8), 0.5)
    peaks = [Peak(2.3, 1.2), Peak(2.4, 1.4), Peak(3.1, 9.0)]
    assert big_plot.line_in(spectrum, peaks, big_plot.cell_of(2.3, 4.0, 8), 4.0, 8) == peaks[1]
    assert big_plot.cell_of(4.0, 4.0, 8) == 7
    assert big_plot.line_at(spectrum, peaks, 2.34) == peaks[0]
    assert big_plot.line_at(Spectrum(np.arange(8.0), 0.4), peaks[2:], 2.3) == Peak(2.3, 5.0)  # as lines move


def test_no_amplitude_is_written_in_db():
    assert big_plot.level_words(0.0, "dB", "m") == "-inf dB"
    assert big_plot.level_words(10.0, "dB", "m") == "20.0 dB"


@pytest.mark.parametrize(
    ("way", "shown"), [("linear", [0.0, 1e-9, 100.0]), ("log", [-4.0, -4.0, 2.0]), ("dB", [-80.0, -80.0, 40.0])]
)
def test_what_is_far_below_the_largest_amplitude_stands_at_the_least(way, shown):
    assert big_plot.levels(np.array([0.0, 1e-9, 100.0]), way) == pytest.approx(shown)


def test_without_any_amplitude_there_is_a_flat_line():
    assert big_plot.levels(np.zeros(3), "log").tolist() == big_plot.levels(np.zeros(3), "dB").tolist() == [0.0] * 3


@pytest.mark.parametrize(("way", "lowest"), [("linear", 0.0), ("dB", 50.0)])
def test_amplitudes_stand_on_zero_and_decibels_on_the_least(way, lowest):
    plot = big_plot.of_spectra([Spectrum(np.linspace(1e3, 2e3, 90), 1.0)], [], way, SIZE, None)
    words = [float(word) for word in plot.left.values()]
    assert min(words) == 0.0 if way == "linear" else min(words) >= lowest


@pytest.mark.parametrize("count", [90, 900])
def test_a_spectrum_that_ends_before_the_other_is_drawn_no_farther(count):
    slow, fast = Spectrum(np.ones(count), 1.0), Spectrum(np.full(3 * count, 0.5), 1.0)
    plot = big_plot.of_spectra([slow, fast], [], "linear", SIZE, None)
    cells = np.flatnonzero((plot.owners == 0).any(axis=0))
    assert cells.max() == pytest.approx(SIZE[0] / 3, abs=1.5)
    assert (plot.owners == 1).any(axis=0)[-3:].all()


@pytest.mark.parametrize("count", [90, 4000])
def test_of_a_spectrum_the_lower_frequencies_are_drawn_as_if_there_were_no_others(count):
    lines = np.random.default_rng(1).random(count)
    near = big_plot.of_spectra([Spectrum(lines, 1.0)], [], "linear", SIZE, None, count / 2)
    assert near.below[-1] == {90: (pytest.approx(40 / 45), "40 Hz"), 4000: (1.0, "2000 Hz")}[count]
    alone = big_plot.of_spectra([Spectrum(lines[: count // 2], 1.0)], [], "linear", SIZE, None)
    assert np.mean(near.owners == alone.owners) > 0.95  # what the first line beyond it is, is seen between lines
    assert big_plot.line_in(Spectrum(lines, 1.0), [], 30, count / 2, SIZE[0]).frequency_hz == pytest.approx(
        count / 4, abs=count / SIZE[0]
    )


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("a drift", lambda t, noise: t),
        ("a step", lambda t, noise: (t > 4.3) + 0.05 * noise),
        ("what runs out", lambda t, noise: np.exp(-t / 3)),
        ("one that goes round once", lambda t, noise: np.sin(2 * np.pi * t / 10)),
        ("noise that is slow rather than fast", lambda t, noise: np.convolve(noise, 0.95 ** np.arange(200))[: len(t)]),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_what_does_not_go_round_has_no_peak_and_a_wave_on_it_is_the_only_one(name, values):
    t = np.arange(4000) / 400
    drift = values(t, np.random.default_rng(3).normal(0, 1, len(t)))

    def peaks(signal):
        return peaks_of(spectrum_of(longest_piece((t * 1e9).astype(np.int64), signal)), 64)

    assert peaks(drift) == []
    size = float(np.ptp(drift))
    (wave,) = peaks(drift + size * np.sin(2 * np.pi * 12.3 * t))
    assert wave.frequency_hz == pytest.approx(12.3, abs=0.05)


def test_what_is_told_of_a_spectrum_that_goes_on_stands_still():
    """As the large plot computes it anew each second: a weak wave was a peak and none, and of two as high each led."""
    t = np.arange(24_000) / 400
    rng = np.random.default_rng(6)
    weak = 0.21 * np.sin(2 * np.pi * 10.1 * t) + rng.normal(0, 1.6, len(t))
    swaps = (1 + 0.05 * np.sin(t)) * np.sin(2 * np.pi * 5 * t) + (1 - 0.05 * np.sin(t)) * np.sin(2 * np.pi * 9 * t)
    for signal in (weak, swaps):
        told = {True: [], False: []}
        for still, found in told.items():
            known = ()
            for at in range(0, 20_000, 400):
                piece = longest_piece((t[at : at + 4000] * 1e9).astype(np.int64), signal[at : at + 4000])
                known = peaks_of(spectrum_of(piece), 64, known if still else ())
                found.append(round(known[0].frequency_hz) if known else 0)
        flips = {still: sum(one != other for one, other in pairwise(found)) for still, found in told.items()}
        assert flips[False] > 4
        assert flips[True] <= 2, told[True]


def test_harmonics_of_a_gait_are_peaks_each():
    t = np.arange(4000) / 400
    gait = np.abs(np.sin(2 * np.pi * 2.03 * t))
    found = peaks_of(spectrum_of(longest_piece((t * 1e9).astype(np.int64), gait)))
    assert [round(peak.frequency_hz / 4.06) for peak in found] == list(range(1, 9))
