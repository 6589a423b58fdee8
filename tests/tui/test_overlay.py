"""A saved run over the live plots: aligned by time since start, behind the live curves, nothing that isn't in it."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from silo.core.arrays.columns import ColumnPiece, ColumnStore, HistoryColumns
from silo.core.elements import BufferType, ElementInfo, ElementOptions, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files import write
from silo_tui.model.drawing.plots import Plotted, draw_panel, together
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.overlay import Overlay, ghost_piece, overlay_of
from silo_tui.model.samples.recorded import RecordingSource
from silo_tui.screens.plots.monitor import MonitorScreen
from tests.stand_ins.fake_signals import START_NS

SECOND = 10**9
COLUMN = SECOND // 10
X = "/log/base/position_x"


def saved(seconds: int = 20, began_ns: int = 0, offset: int = 0, **facts) -> Recording:
    """A run of 10 Hz whose values count the tenths of a second since its start."""
    time_ns = 1_700_000_000 * SECOND + np.arange(10 * seconds, dtype=np.int64) * COLUMN
    entries = tuple(RecordedEntry(f"/log/base/position_{axis}", Entry(f"_{axis}", "<f8"), np.arange(10.0 * seconds))
                    for axis in "xyz")  # fmt: skip
    element = RecordedElement("/log/base/position", "m", "vector", (3,), 1, BufferType.LOOPING, 0, entries)
    return Recording("robot", time_ns, offset or len(time_ns), [element], started_ns=began_ns, **facts)


def source_of(recording: Recording) -> RecordingSource:
    return RecordingSource(recording, [element.name for element in recording.elements])


def test_columns_of_the_same_time_since_start_stand_below_one_another():
    source = source_of(saved(began_ns=1_700_000_000 * SECOND))
    live_ns = 1_800_000_000 * SECOND + COLUMN // 3
    first = live_ns // COLUMN + 50  # 5 s after the live start
    ghost = overlay_of("run", source).columns((X,), first, 20, COLUMN, live_ns)
    piece = ghost_piece(ghost, X, first + 20, 20)
    assert piece is not None
    assert np.abs(piece.low - np.arange(50.0, 70.0)).max() <= 1
    assert (ghost.first, ghost.end) == (first, first + 20)


def test_where_the_run_has_nothing_no_ghost_is_drawn():
    overlay = overlay_of("run", source_of(saved(seconds=2)))
    ghost = overlay.columns((X,), 1000, 20, COLUMN, 500 * COLUMN)
    assert ghost_piece(ghost, X, 1020, 20) is None
    assert ghost_piece(ghost, "/log/other", 1020, 20) is None


def test_a_run_whose_start_is_forgotten_counts_from_its_first_tick():
    source = source_of(saved(seconds=2, offset=120))  # of 120 ticks the last 20 are kept
    overlay = overlay_of("run", source)
    assert source.begin_ns - overlay.began_ns == pytest.approx(10 * SECOND, rel=1e-6)
    assert overlay.extent() == "00:10 to 00:11 after its start"


def test_of_signals_that_are_plotted_it_is_told_from_when_to_when_they_are_there():
    whole = saved(seconds=30)
    (element, *_) = whole.elements
    entries = tuple(replace(entry, values=entry.values[-11:]) for entry in element.entries)
    last = replace(element, entries=entries, first=len(whole.time_ns) - 11)
    overlay = overlay_of("run", source_of(replace(whole, elements=(last,))))
    assert overlay.extent() == "00:00 to 00:29 after its start"
    assert overlay.extent(["/log/base/position"]) == "00:28 to 00:29 after its start"
    assert overlay.extent(["/log/other"]) == "nothing of these signals"


def panel(live: np.ndarray, ghost: np.ndarray | None):
    """A curve with its ghost, in 10 x 4 cells: pictures, cells and owners."""
    plotted = Plotted(ElementInfo("/log/x", "m", "scalar", (), (Entry("", "<f8"),), ElementOptions()), 0)
    store = ColumnStore(["/log/x"], 20, COLUMN)
    store.take(HistoryColumns(("/log/x",), 0, COLUMN, live[None], live[None].copy()))
    ghosts = {} if ghost is None else {0: ColumnPiece(ghost, ghost.copy(), np.zeros(20, np.uint8))}
    pictures = draw_panel(store, PlotWindow(), [plotted], [False], 10, 4, lambda name: COLUMN, ghosts)
    return pictures, *together(pictures, 0, len(ghosts))


def test_the_axis_has_room_for_both_and_the_live_curve_is_in_front():
    live, ghost = np.zeros(20), np.full(20, 50.0)
    pictures, _, owners = panel(live, ghost)
    assert pictures[0].axis.scale == pictures[1].axis.scale
    assert pictures[0].axis.scale[1] >= 50
    assert set(owners.ravel().tolist()) == {-1, 0, 1}
    _, _, same = panel(live, live.copy())
    assert 1 not in same


def test_nothing_is_drawn_that_is_in_neither_of_them():
    rng = np.random.default_rng(7)
    for _ in range(50):
        live, ghost = rng.normal(size=20), rng.normal(size=20) * 3
        live[rng.random(20) < 0.3], ghost[rng.random(20) < 0.3] = np.nan, np.nan
        pictures, _, owners = panel(live, ghost)
        for place, picture in enumerate(pictures):
            cells = picture.lit.reshape(4, 4, 10, 2).any(axis=(1, 3))
            assert not (owners == place)[~cells].any()


def test_a_plot_without_a_ghost_is_as_it_was():
    live = np.sin(np.arange(20.0))
    (picture,), cells, _ = panel(live, None)
    assert np.array_equal(cells, together([picture])[0])


@pytest.mark.slow
async def test_O_lays_a_run_over_the_plots_and_lifts_it_again(opened, fake, tmp_path, monkeypatch):
    fake.logs = tmp_path / "logs"
    write(saved(seconds=30), fake.logs, "robot", ["silo"], "old_walk", why="saved by ann")
    async with opened(fake.run(12.0), size=(100, 30)) as screen:
        await screen.press("/")
        await screen.enter("base/position", "m", at="monitor")
        await screen.do("recordings", shows="old_walk")
        await screen.do("overlay_recording", shows="lies over the plots, with data 00:00 to 00:29")
        await screen.press("escape")
        await screen.until(lambda: type(screen.app.screen) is MonitorScreen, "plots")
        await screen.shows("' old_walk")
        stack = screen.app.screen.stack
        await screen.until(lambda: stack.ghost is not None and stack.ghosts_of(stack.panels[0]), "the ghost")
        ghost = ghost_piece(stack.ghost, X, stack.store.end, stack.columns)
        newest_s = (stack.store.end * stack.store.column_ns - START_NS) / SECOND
        assert ghost.high[-1] == pytest.approx(10 * newest_s, abs=20)
        assert any("'" in line for line in screen.text.splitlines()[2:-3])
        fake.advance(5.0)
        await screen.until(lambda: stack.store.end * stack.store.column_ns > START_NS + 16 * SECOND, "time goes by")
        assert ghost_piece(stack.ghost, X, stack.store.end, stack.columns).high[-1] > ghost.high[-1]
        status = screen.session.status  # a cut is no new start
        cut = msgspec.structs.replace(status, started_ns=START_NS + 16 * SECOND, begun_ns=START_NS, before_ticks=6400)
        screen.session.status = cut
        columns, began = Overlay.columns, []
        monkeypatch.setattr(Overlay, "columns", lambda *given: began.append(given[-1]) or columns(*given))
        await screen.app.screen._fill_ghost(stack.store)
        assert set(began) == {START_NS}
        await screen.do("recordings", at="recordings")
        await screen.shows("old_walk")
        await screen.do("overlay_recording", shows="lifted")
        await screen.press("escape")
        await screen.until(lambda: stack.ghost is None, "no ghost")


@pytest.mark.slow
async def test_a_run_that_has_nothing_here_says_where_it_has_and_where_here_is(opened, fake, tmp_path):
    fake.logs = tmp_path / "logs"
    write(saved(seconds=30), fake.logs, "robot", ["silo"], "old_walk", why="saved by ann")
    async with opened(fake.run(120.0), size=(100, 30)) as screen:
        await screen.press("/")
        await screen.enter("base/position", "m", at="monitor")
        await screen.do("recordings", shows="old_walk")
        await screen.do("overlay_recording", shows="lies over the plots")
        await screen.press("escape", shows="' old_walk: 00:00 to 00:29 after its start, here is 02:")
