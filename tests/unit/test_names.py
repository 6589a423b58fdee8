"""One rule for names: what a spelling means is the same at every door."""

import warnings
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

import silo
from silo.analysis.plots.curves import pick
from silo.cli.edits import select
from silo.core.elements import ElementInfo, ElementOptions, Entry, Table
from silo.core.names import Names, begun, component_name, glob_of_regex, is_word, matching
from silo.errors import ElementError, LogWarning, UnknownNameError
from silo.expressions.binding import bind
from silo.judging.checks import table_catalogue
from silo.rpc.words import full_name
from silo_tui.model.lists.conditions import named_in
from silo_tui.model.table import filter as filters
from silo_tui.model.table.state import TableState

NAMES = ("joints/q", "joints/tau", "imu/acc", "mode")
SPELLINGS = ("/log/joints/q", "joints/q", "/joints/q", "log/joints/q", "q", "*q")
SEVERAL = {"joints": 2, "/joints": 2, "log/joints": 2, "joints/*": 2, "/log/joints/*": 2, "*o*": 4}
ONE, ALL = (
    ("log[]", "in log", "expressions", "topic", "logger[]", "in logger", "logger.elements[]"),
    ("log.names", "log.glob", "to_pandas", "plot", "watch, set", "record", "logger.set"),
)


_number = count()


def made(folder, *names):
    # a second one of its name would end the first, which tests share
    log = silo.Logger(f"names{next(_number)}", frequency=100, folder=folder, script=folder / "no.yaml")
    for name in names:
        log.add(np.zeros(()), name)
    log.start()
    log.collect()
    return log


@pytest.fixture(scope="module")
def logger(tmp_path_factory):
    log = made(tmp_path_factory.mktemp("names"), *NAMES)
    yield log
    log.close()


def shown(table, text):
    """What the terminal's filter shows."""
    state = TableState()
    state.load(table)
    state.prefix = "/log"
    mask = filters.parse(text).mask(state, np.zeros(len(state), bool))
    return [state.names[row] for row in np.flatnonzero(mask)]


@pytest.fixture(scope="module")
def walker():
    """A table of elements with named components."""
    layouts = {"/log/command": ("_forward", "_turn"), "/log/legs/q": ("_FL_hip", "_FR_hip"), "/log/m": ("_0_0", "_0_1")}
    return [
        ElementInfo(name, "-", "array", (2,), tuple(Entry(suffix, "<f8") for suffix in suffixes), ElementOptions())
        for name, suffixes in layouts.items()
    ]


@pytest.mark.parametrize(
    ("text", "owner", "suffix"),
    [
        ("forward", "/log/command", "_forward"), ("command/turn", "/log/command", "_turn"),
        ("FR_hip", "/log/legs/q", "_FR_hip"), ("q[FL_hip]", "/log/legs/q", "_FL_hip"), ("m[0,1]", "/log/m", "_0_1"),
    ],
)  # fmt: skip
def test_a_component_is_found_by_its_name_at_every_door(walker, text, owner, suffix):
    catalogue = table_catalogue(walker, "/log")
    assert [catalogue.name(*one) for one in catalogue.find(text)] == [owner + suffix]
    assert named_in(f"abs({text}) > 1", walker, "/log") == [owner]
    if "[" not in text and "/" not in text:
        assert shown(Table(1, walker), text.lower()) == [owner]


def test_numbers_and_axes_of_components_are_no_names():
    assert [component_name(suffix) for suffix in ("_3", "_0_1", "_x", "_0_x", "")] == ["[3]", "[0,1]", "x", "0_x", ""]
    assert not any(map(is_word, ("[3]", "[0,1]", "x", "")))
    assert is_word("forward")


def meant(door, logger, text):
    """The whole names that a text means at a door."""
    run, table = silo.Log(logger.snapshot()), Table(1, list(logger.elements))
    names = [info.name for info in table.elements]
    catalogue = table_catalogue(table.elements, "/log")
    doors = {
        "log[]": lambda: [run[text].name],
        "in log": lambda: [run[text].name] if text in run else [],
        "log.names": lambda: run.names(text),
        "log.glob": lambda: [one.name for one in run.glob(text)],
        "to_pandas": lambda: list(run._table(text)[0]),
        "plot": lambda: [one.name for one in pick(run.recording, [text])],
        "watch, set": lambda: [names[place] for place in select(names, [text], "/log")],
        "record": lambda: matching(names, [text]),
        "expressions": lambda: [names[one.element] for one in bind(f"abs({text})", catalogue).columns],
        "triggers": lambda: named_in(f"abs({text}) > 1", table.elements, "/log"),
        "limits": lambda: [catalogue.name(*one) for one in catalogue.find(text)],
        "topic": lambda: [full_name(text, SimpleNamespace(logger="names", prefix="/log"), table)],
        "logger[]": lambda: [logger[text].name],
        "in logger": lambda: [logger[text].name] if text in logger else [],
        "logger.elements[]": lambda: [logger.elements[text].name],
        "logger.set": lambda: [names[place] for place in logger._table.select(text)],
        "filter": lambda: shown(table, text),
    }
    return doors[door]()


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("door", [*ONE, *ALL, "limits", "triggers"])
def test_six_spellings_mean_the_same_element_at_every_door(logger, door, spelling):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert meant(door, logger, spelling) == ["/log/joints/q"]


@pytest.mark.parametrize("text", ["/log/joints/?", "/joints/?", "joints/?", "log/joints/?", "?", "*q"])
def test_the_terminals_filter_means_by_a_pattern_what_commands_mean(logger, text):
    assert meant("filter", logger, text) == ["/log/joints/q"] == meant("watch, set", logger, text)


@pytest.mark.parametrize("text", SEVERAL)
@pytest.mark.parametrize("door", ALL)
def test_a_namespace_and_a_glob_mean_the_same_elements_at_every_door(logger, door, text):
    assert len(meant(door, logger, text)) == SEVERAL[text]


@pytest.mark.parametrize("door", [one for one in (*ONE, *ALL) if not one.startswith("in ")])
def test_nothing_found_names_what_was_meant_at_every_door(logger, door):
    if door == "log.names" or door in ("log.glob", "to_pandas"):
        with pytest.warns(LogWarning, match="joints/tau"):
            assert meant(door, logger, "joints/tua") == []
    elif door == "record":
        assert not meant(door, logger, "joints/tua")
    else:
        with pytest.raises((ElementError, UnknownNameError), match="joints/tau"):
            meant(door, logger, "joints/tua")


@pytest.mark.parametrize("door", [one for one in ONE if not one.startswith("in ")])
def test_what_may_be_several_names_the_candidates(tmp_path, door):
    log = made(tmp_path, "left/q", "right/q")
    try:
        with pytest.raises((ElementError, UnknownNameError), match=r"'q' may be /log/left/q, /log/right/q"):
            meant(door, log, "q")
        assert "q" not in log
        assert "q" not in silo.Log(log.snapshot())
    finally:
        log.close()


@pytest.mark.parametrize("door", ["watch, set", "plot", "record"])
def test_what_a_name_meant_besides_the_first_it_means_for_one_release_and_says_so(tmp_path, door, recwarn, capsys):
    log = made(tmp_path, "q", "legs/q")
    try:
        assert meant(door, log, "q") == ["/log/q", "/log/legs/q"]
        told = capsys.readouterr().err + "".join(str(one.message) for one in recwarn)
        assert door == "record" or "write '*/q' for all" in told
        assert meant("log[]", log, "q") == ["/log/q"]
    finally:
        log.close()


@pytest.mark.parametrize("door", ["log.names", "logger.set"])
def test_a_glob_of_a_program_stays_what_it_was_for_one_release_and_says_so(tmp_path, door, recwarn, caplog):
    log = made(tmp_path, "tau", "arm/tip")
    try:
        assert meant(door, log, "t*") == ["/log/tau"]
        assert "write '/log/t*'" in "".join([*caplog.messages, *(str(one.message) for one in recwarn)])
        assert meant("record", log, "t*") == ["/log/tau", "/log/arm/tip"]
    finally:
        log.close()


def test_a_regular_expression_is_told_as_the_glob_that_it_is():
    known = Names(["/log/LF/torque", "/log/RF/torque"], "/log")
    for regex, glob in (("torque$", "*torque"), ("^/log/.*torque", "/log/*torque*"), ("L.*e$", "*L*e")):
        assert known.hint(regex, "") == f"; did you mean '{glob}'?"
        assert known.find(glob)
    assert [glob_of_regex(text) for text in ("torque", "tor*", "a.b", "(a|b)$", "$")] == [""] * 5


def test_what_was_not_typed_to_its_end_is_meant_rather_than_what_is_spelled_alike():
    names = Names(["/log/base/tilt", "/log/battery/voltage", "/log/legs/voltage_drop"], "/log")
    assert names.near("batt", 1) == ["/log/battery/voltage"]
    assert names.near("volt") == ["/log/battery/voltage", "/log/legs/voltage_drop"]
    assert names.near("base/tild", 1) == ["/log/base/tilt"]


def test_a_scalar_has_three_spellings():
    names = Names(["/log/acc", "/imu"], "/log", lambda: [["/log/acc_x", "/log/acc_y"], ["/imu/q/w"]])
    for text in ("acc_y", "acc/y", "/log/acc_y"):
        assert names.find(text, scalars=True) == [(0, 1)]
    assert names.find("imu/q_w", scalars=True) == [(1, 0)]
    assert not names.find("acc_y")


def test_removing_takes_what_waits_for_the_next_update_by_the_same_rule(tmp_path):
    log = made(tmp_path, "arm/q")
    try:
        log.stop()
        log.add(np.zeros(()), "q")
        assert log.remove("q") == 1
        assert [info.name for info in log.elements] == ["/log/arm/q"]
    finally:
        log.close()


def test_completion_offers_the_names_that_begin_so_or_do_behind_a_slash():
    names = ["/log/joints/q", "/log/joints/tau", "/log/jaw"]
    assert begun(names, "/log/joi") == names[:2]
    assert begun(names, "joints/t") == ["/log/joints/tau"]
    assert begun(names, "j") == names
