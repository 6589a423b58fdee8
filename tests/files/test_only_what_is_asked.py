"""Of a log with many signals, each operation reads the values of the signals that it is about, in every format."""

import contextlib
import itertools
import math
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

import silo
from silo.cli.logs.saved_logs import plot_command, print_file_info, stats_command
from silo.core.conditions import Conditions, SignalLimits
from silo.core.elements import BufferType, Entry
from silo.core.recording import LazyEntry, RecordedElement, RecordedEntry, Recording
from silo.files.formats import writer_for

TICKS = 200
SIGNALS = 12
FORMATS = [".silo", ".mcap", ".rosbag2", ".csv", ".parquet", ".mat", ".npz", ".h5"]


def recording():
    noise = np.random.default_rng(7).random((SIGNALS, TICKS))
    elements = [
        RecordedElement(f"/log/g{k // 4}/s{k}", "m", "scalar", (), 1, BufferType.LOOPING, 0,
                        (RecordedEntry(f"/log/g{k // 4}/s{k}", Entry("", "<f8"), noise[k]),))
        for k in range(SIGNALS)
    ]  # fmt: skip
    stamps = np.arange(TICKS, dtype=np.int64) * 10**7 + 1_700_000_000_000_000_000
    limits = Conditions(limits=(SignalLimits("/log/g1/s5", bounds=(0.0, None, None, 1.0)),))
    return Recording("many", stamps, TICKS, elements, frequency_hz=100.0, conditions=limits)


@pytest.fixture(params=FORMATS)
def path(request, tmp_path):
    path = tmp_path / f"many{request.param}"
    with contextlib.ExitStack() as stack:
        if request.param in (".parquet", ".mat", ".h5"):
            stack.enter_context(missing_library_skips())
        writer_for(path)(recording(), path, None)
    return path


@contextlib.contextmanager
def missing_library_skips():
    try:
        yield
    except silo.SiloError as error:
        pytest.skip(str(error))


@pytest.fixture
def read(monkeypatch):
    """The names of the signals whose values are read, in turn."""
    found = []
    real = LazyEntry.__getattr__

    def noted(self, name):
        if name == "values":
            found.append(self.__dict__["name"])
        return real(self, name)

    monkeypatch.setattr(LazyEntry, "__getattr__", noted)
    return found


def shell(command, *arguments):
    result = CliRunner().invoke(command, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def told(path: Path) -> str:
    with CliRunner().isolation() as (output, *_):
        print_file_info(path, as_json=False)
        return output.getvalue().decode()


@pytest.mark.parametrize(("ending", "shape"), [(".mcap", (20, 50)), (".h5", (64, 65))])
def test_of_a_picture_each_entry_takes_as_much_as_one_of_few(ending, shape, tmp_path):
    entries = tuple(
        RecordedEntry(f"/log/image_{k}", Entry(f"_{k}", "<f8"), np.full(2, float(k))) for k in range(math.prod(shape))
    )
    one = RecordedElement("/log/image", "", "array", shape, 1, BufferType.LOOPING, 0, entries)
    with missing_library_skips():
        writer_for(tmp_path / f"x{ending}")(
            Recording("image", np.array([0, 10**7]), 2, [one]), tmp_path / f"x{ending}", None
        )
    calls = itertools.count()
    tracemalloc.start()
    sys.setprofile(lambda *_: next(calls) and None)
    try:
        values = silo.open_log(tmp_path / f"x{ending}")["image"].values
    finally:
        sys.setprofile(None)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert values[1].ravel().tolist() == list(range(math.prod(shape)))
    assert next(calls) < 500 * len(entries)
    assert peak < 10_000 * len(entries)


def test_names_types_units_and_counts_read_no_value(path, read):
    log = silo.open_log(path)
    assert len(log) == SIGNALS
    assert "g1/s5" in log
    assert "nothing" not in log
    assert log.names("g1/*") == [f"/log/g1/s{k}" for k in range(4, 8)]
    assert [(one.unit, one.count, str(one.entries[0].dtype)) for one in log.recording.elements] == [
        ("m", TICKS, "float64")
    ] * SIGNALS
    assert "/log/g1/s5" in log._repr_html_()
    assert read == []


def test_info_reads_no_value(path, read):
    text = told(path)
    assert f"{SIGNALS} elements, {TICKS} ticks" in text
    assert "float64" in text
    assert read == []


def test_completion_reads_no_value(path, read):
    complete = ShellComplete(plot_command, {}, "silo plot", "_SILO_COMPLETE")
    names = [item.value for item in complete.get_completions([str(path)], "g1/s")]
    assert [name.rpartition("/")[2] for name in names] == ["s4", "s5", "s6", "s7"]
    assert read == []


@pytest.mark.parametrize("command", [stats_command, plot_command], ids=lambda command: command.name)
def test_stats_and_plot_read_what_they_show(path, read, command):
    assert "g1/s5" in shell(command, path, "g1/s5")
    assert set(read) == {"/log/g1/s5"}


def test_an_expression_reads_what_it_names(path, read):
    found = silo.open_log(path).eval("g1/s5 > 0.5 and g2/s9 > 0.5")
    assert len(found) == TICKS
    assert set(read) == {"/log/g1/s5", "/log/g2/s9"}


def test_a_part_of_a_log_reads_what_is_asked_of_it(path, read):
    log = silo.open_log(path)
    assert len(log.clip(0.5, 1.0)["g1/s5"]) > 40
    assert len(log.namespace("g1")["g1/s4"]) == TICKS
    assert len(log.resample(50)["g2/s8"]) >= TICKS // 2 - 1
    assert set(read) == {"/log/g1/s5", "/log/g1/s4", "/log/g2/s8"}
