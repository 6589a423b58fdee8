"""What is plotted, written to a file."""

import asyncio
import csv
from pathlib import Path

import numpy as np
import pytest

from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo.errors import SiloError
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.plots.panels import stacked
from silo_tui.screens.dialogs.exporting import csv_text, export, free_name


def plotted(name, unit="Nm", dtype="<f8"):
    return Plotted(ElementInfo(name, unit, "scalar", (), (Entry("", dtype),), ElementOptions()), 0)


A, STATE = plotted("/a"), plotted("/state", "-", "|S8")
FAST = (np.array([10, 20, 30, 40]), np.array([0.1, np.nan, 1 / 3, -np.inf]))
SLOW = (np.array([10, 30]), np.array([b"walk", b"a, b"], "S8"))


class Held:
    """Samples that stand still."""

    def __init__(self, **found):
        self.found = found

    async def samples(self, name, start_ns, end_ns):
        return self.found[name[1:]]


def write(path, source=None):
    source = source or Held(a=FAST, state=SLOW)
    return asyncio.run(export(None, source, stacked([A, STATE]), (0, 50), 0, path))


def test_a_csv_has_every_sample_with_all_its_digits_and_nothing_where_there_is_none():
    rows = list(csv.reader(csv_text([A, STATE], [FAST, SLOW]).splitlines()))
    assert rows[0] == ["time_ns", "/a [Nm]", "/state"]
    assert rows[1:] == [["10", "0.1", "walk"], ["20", "nan", ""], ["30", repr(1 / 3), "a, b"], ["40", "-inf", ""]]


def test_where_a_file_is_that_was_named_without_a_folder_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert write(Path("plots.csv")).endswith(f" are in {tmp_path / 'plots.csv'}")


def test_what_was_written_is_counted(tmp_path):
    assert write(tmp_path / "plots.csv").startswith("6 samples of 2 signals are in ")
    assert (tmp_path / "plots.csv").read_text().startswith("time_ns,")


def test_a_png_is_a_picture(tmp_path):
    pytest.importorskip("matplotlib")
    write(tmp_path / "plots.png")
    assert (tmp_path / "plots.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_has_each_sample_at_its_time_and_holds_it_until_the_next(tmp_path, monkeypatch):
    agg = pytest.importorskip("matplotlib.backends.backend_agg")
    drawn = []
    monkeypatch.setattr(agg.FigureCanvasAgg, "print_png", lambda canvas, file: drawn.append(canvas.figure))
    write(tmp_path / "plots.png")
    numbers, words = (axes.get_lines()[0] for axes in drawn[0].axes)
    assert (numbers.get_label(), words.get_label()) == ("/a [Nm]", "/state")
    np.testing.assert_array_equal(numbers.get_xydata().T, [FAST[0] / 1e9, FAST[1]])
    np.testing.assert_array_equal(words.get_xydata().T, [SLOW[0] / 1e9, [0, 1]])
    assert words.get_drawstyle() == "steps-post"
    assert [each.get_text() for each in words.axes.get_yticklabels()] == ["walk", "a, b"]
    assert drawn[0].axes[-1].get_xlabel() == "time [s]"


def test_a_file_that_is_there_stays_as_it_was(tmp_path):
    (tmp_path / "plots.csv").write_text("mine")
    with pytest.raises(SiloError, match="exists: choose another name; nothing was written"):
        write(tmp_path / "plots.csv")
    assert (tmp_path / "plots.csv").read_text() == "mine"


def test_an_ending_that_nobody_knows_is_refused(tmp_path):
    with pytest.raises(SiloError, match="ends in none of"):
        write(tmp_path / "plots.bmp")


def test_nothing_to_write_is_no_empty_file(tmp_path):
    nothing = (np.zeros(0, np.int64), np.zeros(0))
    with pytest.raises(SiloError, match="no samples in what is shown"):
        write(tmp_path / "plots.csv", Held(a=nothing, state=nothing))
    assert not (tmp_path / "plots.csv").exists()


def test_a_name_is_proposed_that_no_file_has(tmp_path):
    assert free_name(tmp_path / "plots.csv") == tmp_path / "plots.csv"
    (tmp_path / "plots.csv").touch()
    (tmp_path / "plots-2.csv").touch()
    assert free_name(tmp_path / "plots.csv") == tmp_path / "plots-3.csv"
