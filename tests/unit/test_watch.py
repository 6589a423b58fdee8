"""What `silo watch` prints of the frames that come."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from silo.cli.codes import EXIT_NO_LOGGER
from silo.cli.main import run
from silo.core.elements import ElementInfo, ElementOptions, Entry, State
from silo.rpc.frames import Frame
from silo.rpc.published import NotLive


def info(name, *dtypes, enabled=True, labels=None, **more):
    entries = tuple(Entry("" if len(dtypes) == 1 else f"_{place}", dtype, labels) for place, dtype in enumerate(dtypes))
    return ElementInfo(name, more.pop("unit", "-"), "scalar", (), entries, ElementOptions(enabled=enabled), **more)


def frame(newest, *, held=None, tick=1, state=State.RUNNING, **more):
    held = np.ones(1, np.int64) if held is None else np.array(held, np.int64)
    nothing = np.zeros((0, 0))
    return Frame(
        (), (), (), frozenset(), frozenset(), 0, tick, state, 100.0, 3, held, held, np.array(newest, float),
        more.pop("texts", {}), 1, 0, nothing, nothing, None, {}, 0, {}, 0, **more,
    )  # fmt: skip


class Client(SimpleNamespace):
    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def watched(monkeypatch, capsys):
    """Watches a logger that has these elements and sends these frames; returns exit status, lines and what is told."""

    def watch(infos, frames, *words, derived=()):
        left = [None, *frames]  # as long as nothing has come
        views = []

        def view(names, plots, rate, column_ns):
            views.append(SimpleNamespace(frame=lambda: left.pop(0), refused="", closed=False))
            views[-1].close = lambda: setattr(views[-1], "closed", True)
            return views[-1]

        client = Client(
            table=lambda: SimpleNamespace(elements=list(infos), derived=list(derived)), view=view, connected=True,
            status=lambda: SimpleNamespace(reason="the robot program died"),
        )  # fmt: skip
        monkeypatch.setattr("silo.cli.loggers.watch.connect", lambda logger: client)
        code = run(["watch", *words])
        assert all(one.closed for one in views)
        said = capsys.readouterr()
        return code, said.out.splitlines(), said.err.splitlines()

    return watch


@pytest.mark.parametrize("off", [0, 10, 11])
def test_ten_that_are_off_are_named_and_the_others_counted(off, watched):
    infos = [info("/log/x", "<f8"), *(info(f"/log/off{place}", "<f8", enabled=False) for place in range(off))]
    _, lines, told = watched(infos, [frame([1])], "/log", "-n", "1")
    assert lines == ["--:--:--.---  /log/x  1"]
    more = ["and 1 more"] if off > 10 else []
    assert told == [*(f"/log/off{place}: off" for place in range(min(off, 10))), *more]


@pytest.mark.parametrize(("many", "shown"), [(20, 20), (21, 20)])
def test_who_names_nothing_is_shown_the_first_twenty_and_told_so(many, shown, watched):
    names = [f"/log/x{place}" for place in range(many)]
    _, lines, told = watched([info(name, "<f8") for name in names], [frame([1] * shown, held=[1] * shown)], "-n", "1")
    assert [line.split()[1] for line in lines] == names[:shown]
    assert told == (["the first 20 of 21 elements that are on; say which: `silo watch PATTERN`"] if many > 20 else [])


@pytest.mark.parametrize(
    ("dtypes", "labels", "values", "texts", "line"),
    [
        (["<i4"], None, [12345678.0], {}, "12345678 m"),
        (["<f8"], None, [12345678.0], {}, "1.23457e+07 m"),
        (["|b1", "|b1"], None, [1, 0], {}, "true false m"),
        (["<i4", "<i4"], {-1: "BACK"}, [-1, 2], {}, "BACK 2 m"),
        (["<u8", "<u8"], {2**63 + 1: "FAR"}, [0, 0], {0: str(2**63 + 1), 1: "9"}, "FAR 9 m"),
        (["|S8"], None, [np.nan], {0: "5"}, "5 m"),
        (["<f8"] * 16, None, [1] * 16, {}, " ".join("1" * 16) + " m"),
        (["<f8"] * 17, None, [1] * 17, {}, " ".join("1" * 16) + " ... (17 values) m"),
    ],
)
def test_a_line_shows_values_as_their_types_want_them(dtypes, labels, values, texts, line, watched):
    _, lines, _ = watched([info("/log/x", *dtypes, labels=labels, unit="m")], [frame(values, texts=texts)], "-n", "1")
    assert lines == [f"--:--:--.---  /log/x  {line}"]


@pytest.mark.parametrize(
    ("states", "told"),
    [
        ("running running", []),
        ("running stopped stopped running", ["stopped", "running"]),
        ("stopped stopped running", ["stopped", "running"]),
    ],
)
def test_a_state_is_told_as_it_changes_and_at_first_where_it_is_not_running(states, told, watched):
    frames = [frame([1.0], state=State(state)) for state in states.split()]
    shown = watched([info("/log/x", "<f8")], frames, "-n", str(len(frames)))
    assert shown[2] == [f"logger is {state}" for state in told]


def test_a_watch_ends_as_the_robot_program_dies(watched):
    code, lines, told = watched([info("/log/x", "<f8")], [frame([1]), None, frame([1], state=State.DEAD)])
    assert (code, len(lines), "the robot program died" in told[-1]) == (EXIT_NO_LOGGER, 1, True)


@pytest.mark.parametrize(
    ("dtype", "value", "text", "wanted"),
    [
        ("<i4", 7.0, None, 7),
        ("<u8", 2.0**63, str(2**63 + 1), 2**63 + 1),
        ("<f8", 7.0, None, 7.0),
        ("<i4", np.nan, None, None),
        ("|b1", 1.0, None, True),
        ("|S8", np.nan, "hello", "hello"),
    ],
)
def test_as_json_a_value_is_what_its_type_says(dtype, value, text, wanted, watched):
    shown = frame([0, value], held=[1, 1], texts={1: text} if text else {}, failed={1: 2}, not_live={0: NotLive.FULL})
    code, lines, _ = watched([info("/log/x", "<f8"), info("/log/y", dtype)], [shown], "--json", "-n", "1")
    told = json.loads(lines[0])
    value = told["values"]["/log/y"]
    assert (code, value, type(value)) == (0, wanted, type(wanted))
    assert (told["failed"], told["not_live"]) == ({"/log/y": 2}, {"/log/x": NotLive.FULL.value})
    assert (told["tick"], told["lost"], told["state"]) == (1, 3, "running")
