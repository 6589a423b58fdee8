"""What a view keeps, as its file says it: written, read again, and mistakes in it told."""

import os
import stat

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.errors import SaveError
from silo_tui.layouts import files
from silo_tui.layouts.layout import KeptLayout
from silo_tui.layouts.texts import FIELDS, read, write

names = st.text("aZé19 /_.:#-~*'\"[{,", max_size=12).map(str.strip)
numbers = st.floats(-1e12, 1e12)
# a signal stands in one plot
panels = st.lists(names.filter(bool), unique=True, max_size=6).flatmap(
    lambda given: st.lists(st.integers(1, 3), min_size=len(given), max_size=len(given)).map(
        lambda sizes: tuple(
            tuple(given[sum(sizes[:at]) : sum(sizes[: at + 1])])
            for at in range(len(sizes))
            if given[sum(sizes[:at]) : sum(sizes[: at + 1])]
        )
    )
)
layouts = st.builds(
    KeptLayout,
    sort=names, turned=st.booleans(), filter=names, set=names,
    folded=st.lists(names, unique=True, max_size=3).map(tuple),
    unfolded=st.lists(names, unique=True, max_size=3).map(tuple),
    components=st.dictionaries(names, names, max_size=2), columns=st.lists(names, unique=True, max_size=3).map(tuple),
    plots=panels, chosen=names,
    span_s=st.floats(1e-3, 1e6),
    scales=st.dictionaries(names, st.tuples(numbers, numbers).filter(lambda ends: ends[0] < ends[1]), max_size=2),
    logs=st.lists(names, unique=True, max_size=3).map(tuple),
    most=st.integers(0, 100),
)  # fmt: skip


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(layouts)
def test_what_is_written_is_read_again(layout):
    found, problems = read(write(layout))
    assert not problems
    assert found == layout


WHOLE = KeptLayout(
    "div", turned=True, filter="bäse", columns=("div", "size"), set="statistics", folded=("/legs",),
    unfolded=("/base/velocity",), components={"/imu/gyro": "norm", "/base/position": "_y"},
    plots=(("/a", "/b"), ("/c",)), chosen="/b", span_s=2.5, scales={"/a|/b": (-1.0, 2.5)}, logs=("/c",),
)  # fmt: skip
WRITTEN = """\
sort: div
turned: true
filter: bäse
columns:
- div
- size
set: statistics
folded:
- /legs
unfolded:
- /base/velocity
components:
  /imu/gyro: norm
  /base/position: _y
plots:
- - /a
  - /b
- /c
chosen: /b
span_s: 2.5
scales:
  /a|/b:
  - -1.0
  - 2.5
logs:
- /c
"""


@pytest.mark.parametrize(("layout", "text"), [(WHOLE, WRITTEN), (KeptLayout(), "{}\n")])
def test_a_view_is_written_as_what_differs_from_a_bare_table_and_read_again(layout, text):
    assert write(layout) == text
    assert read(text) == (layout, [])


@pytest.mark.parametrize(
    ("line", "layout"),
    [
        ("turned: False", KeptLayout()), ("filter:", KeptLayout()), ("plots:", KeptLayout()),
        ("columns: [a, b, a]", KeptLayout(columns=("a", "b"))), ("scales:", KeptLayout()), ("logs:", KeptLayout()),
        ("plots: [a, [b, a, c], [c]]", KeptLayout(plots=(("a",), ("b", "c")))),
        ("span_s: 1e-3", KeptLayout(span_s=0.001)),
    ],
)  # fmt: skip
def test_what_somebody_wrote_is_taken_a_signal_once(line, layout):
    assert read(line) == (layout, [])


MISTAKES = [
    ("plts: [a]", "line 1: plts is unknown; did you mean 'plots'?"),
    ("plots: a", "line 1: plots is a list such as [a, b], not a"),
    ("span_s: -1", "line 1: span_s is seconds above 0, not -1"), ("span_s: x", "span_s is a number, not x"),
    ("scales: {a: [2, 1]}", "scales is [bottom, top] for a, not a list"),
    ("scales: {a: [1, 1]}", "scales is [bottom, top] for a"), ("scales: {a: [1]}", "scales is [bottom, top] for a"),
    ("scales: {a: [1, 2, 3]}", "scales is [bottom, top] for a"),
    ("span_s: 0", "span_s is seconds above 0, not 0"),
    ("span_s: .inf", "span_s is a number, not .inf"), ("turned: 1", "turned is true or false, not 1"),
    ("scales: a", "scales is lines such as `joint/torque: [-30, 40]`, not a"), ("scales: {a: 5}", "for a, not 5"),
    ("components: [a]", "components is lines such as `base/position: norm`, not a list"),
    ("filter: [a]", "filter is a text, not a list"), ("plots: [a", "line 1: not valid YAML"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "words"), MISTAKES)
def test_a_mistake_costs_its_line_and_is_told(line, words):
    found, problems = read(f"{line}\nsort: div\n")
    assert found == KeptLayout(sort="div")
    assert words in problems[0]


def test_every_field_of_a_view_can_be_read():
    assert list(KeptLayout.__struct_fields__) == list(FIELDS)


@pytest.mark.parametrize("name", ["", "a/b", "../x", ".last-x", " a", "a" * 81, "-x\n"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="is no name for a view"):
        files.place(name)


@pytest.fixture
def views(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "silo" / "views"


def test_views_are_listed_by_name_but_for_what_was_on_a_screen(views):
    assert files.names() == []
    with pytest.raises(ValueError, match="there is no view 'walk'; `:view save NAME` makes one"):
        files.load("walk")
    for name in ("walk", "a" * 80, "Lab 2.1"):
        files.save(files.place(name), WHOLE)
    files.save(files.left_by_us("robot"), WHOLE)
    (views / "notes.txt").touch()
    assert files.names() == ["Lab 2.1", "a" * 80, "walk"]
    assert files.place("walk") == views / "walk.yaml"
    assert files.load("walk") == (WHOLE, [])
    assert stat.S_IMODE(views.stat().st_mode) == 0o700
    with pytest.raises(ValueError, match="there is no view 'wlak'; did you mean 'walk'"):
        files.load("wlak")
    with pytest.raises(ValueError, match="there is no view 'x'; there are Lab"):
        files.load("x")


def test_a_view_that_cant_be_read_or_written_is_told(views):
    files.place("walk").mkdir(parents=True)
    with pytest.raises(ValueError, match=r"can't read '.*walk.yaml': it is no file"):
        files.load("walk")
    views.parent.rename(views.parent.with_name("gone"))
    views.parent.touch()
    with pytest.raises(SaveError, match="nothing was saved"):
        files.save(files.place("walk"), WHOLE)


def test_what_was_on_a_screen_is_kept_by_logger_terminal_and_process(views, monkeypatch):
    monkeypatch.setattr(os, "ttyname", lambda number: "/dev/pts/7")
    assert files.left_by_us("robot3/any.mal") == views / f".left-robot3_any_mal.pts_7.{os.getpid()}.yaml"
    assert files.left_by_us("r" * 90).name == f".left-{'r' * 80}.pts_7.{os.getpid()}.yaml"
    monkeypatch.setattr("silo_tui.sessions.kept.lives", lambda pid: pid == 12)
    names = ["robot.pts_8.13", "robot.none.11", "robot.pts_7.12", "robot.pts_7.x", "robots.pts_7.14"]
    for at, name in enumerate(names):
        files.save(views / f".left-{name}.yaml", WHOLE)
        os.utime(views / f".left-{name}.yaml", (100 - at, 100 - at))
    assert files.left_last("robot").path.name == ".left-robot.pts_8.13.yaml", "the newest of nobody who is there"
    for at, name in enumerate(["robot.pts_7.21", "robot.pts_7.22"]):
        files.save(views / f".left-{name}.yaml", WHOLE)
        os.utime(views / f".left-{name}.yaml", (50 + at, 50 + at))
    assert files.left_last("robot").path.name == ".left-robot.pts_7.22.yaml", "ours"
    assert not (views / ".left-robot.pts_7.21.yaml").exists()
    files.save(views / ".left-robot.pts_7.22.yaml", KeptLayout())
    assert files.left_last("robot") is None, "this terminal showed nothing at last"
