"""Options, edits, script and names of a logger, and what it refuses."""

import logging
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.core.elements import Action, BufferType, Edit, ElementOptions
from silo.core.runtime import list_segments
from silo.errors import ElementError, ScriptError, SourceError, StateError
from silo.settings.script import read_script

# ------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frequency": 0}, "frequency must be above 0 and below 1e+06 Hz, got 0"),
        ({"frequency": float("nan")}, "frequency must be above 0 and below 1e+06 Hz, got nan"),
        ({"max_time": -1}, "max_time must be from 0 and below 1e+09 s (0: no limit), got -1"),
        ({"name": "a/b"}, "logger name 'a/b': 1 to 40 letters, digits, '_', '-' or '.', a letter or digit "
         "first; write silo.Logger('a_b')"),
        ({"name": ""}, "logger name '': 1 to 40 letters, digits, '_', '-' or '.', a letter or digit first"),
        ({"name": "x" * 41}, "logger name 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx': 1 to 40 letters, "
         "digits, '_', '-' or '.', a letter or digit first; write "
         "silo.Logger('xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx')"),
        ({"storage": "tape"}, "storage must be 'memory', 'disk' or 'file', got 'tape'"),
        ({"size_tiers": 0}, "size_tiers must be a whole number from 1 to 1000, got 0"),
        ({"frequency": "500"}, "frequency must be above 0 and below 1e+06 Hz, got '500'; write frequency=500"),
        ({"frequency": True}, "frequency must be above 0 and below 1e+06 Hz, got True"),
        ({"max_time": None}, "max_time must be from 0 and below 1e+09 s (0: no limit), got None"),
        ({"name": None}, "the logger's name must be a text, got None (NoneType); write silo.Logger(\"robot\")"),
        ({"script": 5}, "script must be a path, got 5; write script='some/path'"),
        ({"folder": 5}, "folder must be a path, got 5; write folder='some/path'"),
        ({"prefix": 5}, 'prefix must be a text, got 5 (int); write prefix="/log"'),
        ({"size_tiers": 2.5}, "size_tiers must be a whole number from 1 to 1000, got 2.5"),
        ({"memory_limit_mb": 1e30}, "memory_limit_mb must be a whole number from 1 to 1000000000, got 1e+30"),
        ({"checked": "yes"}, "checked must be True or False, got 'yes'"),
        ({"clock": 5}, "clock must be a function without arguments, got 5; write clock=lambda: ..."),
        ({"clock": lambda: 1 / 0}, "clock failed when it was asked for the first time (ZeroDivisionError: "
         "division by zero): it must return int nanoseconds or float seconds from now on"),
        ({"clock": lambda: float("nan")}, "clock must return int nanoseconds or float seconds, got nan; either "
         "must fit into 64 bits of nanoseconds"),
        ({"clock": lambda: "noon"}, "clock must return int nanoseconds or float seconds, got 'noon'; either "
         "must fit into 64 bits of nanoseconds"),
        ({"clock": lambda: True}, "clock must return int nanoseconds or float seconds, got True; either must "
         "fit into 64 bits of nanoseconds"),
    ],
)  # fmt: skip
def test_options_out_of_range_are_named(new_logger, options, words):
    with pytest.raises(ElementError) as caught:
        new_logger(**options)
    assert str(caught.value) == words


def test_paths_are_absolute_from_the_start(new_logger, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    options = new_logger(folder="logs", script="a.yaml").options
    assert (options.folder, options.script) == (str(tmp_path / "logs"), str(tmp_path / "a.yaml"))


def test_defaults_are_those_of_the_original(new_logger):
    logger = new_logger(frequency=200)
    logger.array("q")
    logger.update()
    (info,) = logger.elements
    assert (info.name, info.unit) == ("/log/q", "-")
    assert info.options == ElementOptions(True, 1, Action.SAVE, BufferType.LOOPING, 2000)


def test_a_default_buffer_holds_max_time_whatever_the_divider(new_logger):
    logger = new_logger(frequency=100, max_time=10)
    logger.array("q", divider=3)
    logger.update()
    assert logger.elements[0].options.size == 334


def test_storage_on_disk_keeps_the_segment_in_the_folder_of_the_logs(new_logger, tmp_path):
    logger = new_logger(storage="file")
    logger.array("x")
    logger.start()
    assert list_segments(tmp_path) == [Path(logger._present.path)]
    assert Path(logger._present.path).parent == tmp_path


def test_the_segment_is_readable_by_its_user_alone(counting):
    assert Path(counting()._present.path).stat().st_mode & 0o777 == 0o600


# ------------------------------------------------------------------------------------------------------- editing


@pytest.mark.parametrize(
    "call",
    [
        lambda log: log.set("x", divider=2),
        lambda log: log.set(enabled=True),
        lambda log: log.set("x", enabled=False),
        lambda log: log._scripted.apply([]),
        lambda log: log.load_script("none.yaml"),
    ],
)
def test_every_edit_is_refused_while_the_logger_runs(counting, call):
    with pytest.raises(StateError, match=r"stop\(\) it first; nothing was changed"):
        call(counting())


def test_edits_are_one_transaction(counting):
    logger = counting()
    logger.stop()
    good = Edit("/log/x", ElementOptions(divider=2, size=5))
    with pytest.raises(ElementError, match="element '/log/y': the table has no such element; nothing was changed"):
        logger._scripted.apply([good, Edit("/log/y", ElementOptions())])
    assert logger.elements[0].options.divider == 1


# -------------------------------------------------------------------------------------------------------- script


@pytest.mark.parametrize(("reads", "divider"), [({}, 4), ({"read_script": False}, 1)])
def test_update_reads_the_script_if_it_is_there_and_may_leave_it_alone(new_logger, tmp_path, reads, divider):
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - name: /log/x\n    enabled: true\n    divider: 4\n")
    logger = new_logger()
    logger.array("x")
    logger.update(**reads)
    assert logger.elements[0].options.divider == divider


def test_a_script_with_problems_changes_nothing_and_stops_every_start(new_logger, tmp_path):
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - name: /log/x\n    divider: 0\n")
    logger = new_logger()
    logger.array("x")
    for _ in range(2):
        with pytest.raises(ScriptError, match=r"logger\.yaml:3"):
            logger.start()
    assert not logger.is_running


OTHERS_SCRIPT = """log_elements:
  - {name: /log/x, enabled: false}
  - {name: /log/y, enabled: true, divider: 4}
derived_signals:
  - {name: /log/err, expression: "gone - x"}
signal_limits:
  - {name: err, bounds: [-2, -1, 1, 2]}
  - {name: y, bounds: [-2, -1, 1, 2]}
triggers:
  - {name: far, when: "abs(gone) > 2"}
"""


@pytest.mark.parametrize("is_named", [False, True])
def test_a_script_that_is_applied_at_the_start_says_which_and_what_it_changes(new_logger, tmp_path, caplog, is_named):
    script = tmp_path / ("mine.yaml" if is_named else "logger.yaml")
    script.write_text(OTHERS_SCRIPT)
    logger = new_logger(script=script)
    for name in ("x", "y", "z"):
        logger.array(name)
    with caplog.at_level(logging.INFO, "silo"):
        logger.start()
    words = f"{script}: 2 of 3 elements changed, 1 of them switched off; then 1 limit"
    (told,) = [one for one in caplog.records if "is applied" in one.getMessage()]
    assert told.levelno == (logging.INFO if is_named else logging.WARNING)
    assert f"script {script} is applied: {words.partition(': ')[2]}" in told.getMessage()
    assert ("as test.logger.yaml it is this one's alone" in told.getMessage()) is not is_named
    assert logger.snapshot().about["script"] == words


def test_what_a_script_says_of_names_that_are_gone_is_left_out_at_the_start_with_a_warning_each(
    new_logger, tmp_path, caplog
):
    script = tmp_path / "logger.yaml"
    script.write_text(OTHERS_SCRIPT)
    logger = new_logger()
    logger.array("x")
    logger.array("y")
    logger.start()
    assert [one.name for one in logger._conditions.now.limits] == ["y"]
    assert (logger._conditions.now.derived, logger._conditions.now.triggers) == ((), ())
    told = [text for text in caplog.messages if text.endswith("; it is left out")]
    assert [text.partition(": ")[0] for text in told] == [f"{script}:{line}" for line in (5, 7, 10)]
    logger.stop()
    with pytest.raises(ScriptError, match=r"logger\.yaml:5"):  # by who asks for it
        logger.load_script()
    logger.update()  # as a start does
    before = read_script(script).conditions
    logger.save_script()
    assert "kept what this program doesn't have: /log/err, err, far (delete" in caplog.messages[-1]
    after = read_script(script).conditions
    assert (after.derived, after.triggers) == (before.derived, before.triggers)
    assert {one.name for one in after.limits} == {"err", "y"}
    assert [one.name for one in logger._conditions.now.limits] == ["y"]


def test_a_logger_that_names_no_script_has_one_of_its_name_and_reads_that_of_all_where_it_has_none(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.chdir(tmp_path)

    def divider_of(name, **options):
        with silo.Logger(name, folder=tmp_path / "logs", **options) as log:
            x = log.array("x")
            log.update()
            assert x.shape == ()
            return log["x"].options.divider

    with silo.Logger("right", folder=tmp_path / "logs") as log:
        x = log.array("x", divider=7)
        assert log.save_script() == tmp_path / "right.logger.yaml"
        assert x.shape == ()
    assert caplog.messages == []
    assert (divider_of("right"), divider_of("left"), divider_of("right", script=None)) == (7, 1, 1)
    assert (divider_of("right", script=False), divider_of("right", script=True)) == (1, 7)
    (tmp_path / "logger.yaml").write_text("log_elements:\n  - {name: /log/x, enabled: true, divider: 5}\n")
    assert (divider_of("right"), divider_of("left"), divider_of("left", script=None)) == (7, 5, 1)


def test_what_has_no_script_reads_none_at_a_start_either_and_saves_to_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file in ("logger.yaml", "arm.logger.yaml"):
        (tmp_path / file).write_text("log_elements:\n  - {name: /log/x, enabled: true, divider: 5}\n")
    with silo.Logger("arm", script=None, folder=tmp_path) as log:
        x = log.array("x")
        log.start()
        late = log.array("y")
        log.restart()
        assert (log["x"].options.divider, x.shape, late.shape) == (1, (), ())
        assert log.save_script() == tmp_path / "arm.logger.yaml"
        log.stop()
        assert log.load_script(tmp_path / "logger.yaml") == []
        assert log["x"].options.divider == 5


def test_a_start_that_fails_for_its_script_says_how_to_go_on_without_it(new_logger, tmp_path):
    (tmp_path / "logger.yaml").write_text("log_elements: []\nsignal_limits:\n  - {name: x, bounds: [2, 1, 0, -1]}\n")
    logger = new_logger()
    logger.array("x")
    with pytest.raises(ScriptError, match=r"logger\.yaml:3.* must rise(.|\n)*silo\.Logger\(script=.*read_script=False"):
        logger.start()


def test_names_that_the_table_lacks_are_returned_and_warned_of(new_logger, tmp_path, caplog):
    script = tmp_path / "other.yaml"
    script.write_text("log_elements:\n  - name: /log/gone\n    enabled: true\n  - name: /log/x\n    colour: red\n")
    logger = new_logger()
    logger.array("x")
    logger.update()
    caplog.clear()
    assert logger.load_script(script) == ["/log/gone"]
    unknown, off = read_script(script).warnings
    assert caplog.messages == [unknown, off, f"{script}:2: no element '/log/gone'; it is left out"]
    assert {record.levelno for record in caplog.records} == {logging.WARNING}


# ----------------------------------------------------------------------------------------------------------- names


@pytest.mark.parametrize("name", ["a\nb", "a\tb", "\x00", "/", "//"])
def test_names_that_would_break_files_are_refused(new_logger, name):
    with pytest.raises(ElementError, match="element name"):
        new_logger(prefix="").add(np.zeros(1), name)


@pytest.mark.parametrize(
    ("name", "words"),
    [("q", "element '/log/q' is there already"), ("q_x", "another element has a value named '/log/q_x' already")],
)
def test_a_name_that_is_taken_also_by_a_value_of_an_element_is_refused(new_logger, name, words):
    logger = new_logger()
    logger.array("q", 3)
    with pytest.raises(ElementError, match=words):
        logger.array(name)


def test_an_array_without_memory_of_fixed_size_is_refused(new_logger):
    with pytest.raises(SourceError, match="for text give a length: dtype='S32'"):
        new_logger().array("text", 3, str)


def test_a_variable_in_silos_memory_begins_with_zeros(new_logger):
    q = new_logger().array("q", (2, 3), "f4")
    assert (q.shape, q.dtype, q.any()) == ((2, 3), np.float32, np.False_)


def test_variables_in_silos_memory_survive_the_logger(new_logger):
    logger = new_logger()
    q = logger.array("q", 3)
    logger.start()
    logger.close()
    del logger
    q[:] = 5
    assert q.sum() == 15


@pytest.mark.parametrize(("given", "prefix"), [("", ""), ("/", ""), ("a//b/", "/a/b"), ("/log", "/log")])
def test_a_prefix_has_one_slash_before_each_part_and_none_is_none(given, prefix, new_logger):
    logger = new_logger(prefix=given)
    logger.array("x")
    logger.update()
    assert (logger.options.prefix, [one.name for one in logger.elements]) == (prefix, [f"{prefix}/x"])


def test_a_unit_that_is_not_known_is_told_once_with_the_one_that_is_meant(new_logger, caplog):
    logger = new_logger()
    for name in ("a", "b"):
        logger.array(name, unit="radians")
    logger.array("mine", unit="[parsec]")
    logger.array("c", unit="Nm")
    logger.derive("d", "a * b", unit="rads")
    told = [record.getMessage() for record in caplog.records if "unit" in record.getMessage()]
    assert len(told) == 2
    assert "/log/a" in told[0]
    assert "did you mean 'rad'?" in told[0]
    assert "the next release will refuse it" in told[0]
    assert "/log/d" in told[1]
    logger.derive("e", "2 * c", unit=" ")  # a blank one is none: that which follows is
    assert logger._conditions.now.derived[-1].unit == ""


def test_what_a_rate_became_is_told_where_no_divider_gives_it(new_logger, caplog, tmp_path):
    logger = new_logger(frequency=100)
    for name, divider in (("a", "30Hz"), ("b", "50Hz"), ("c", "33.333 Hz"), ("d", 3)):
        logger.array(name, divider=divider)
    logger.update()
    logger.set("b", divider="80Hz")
    script = tmp_path / "rates.yaml"
    script.write_text("log_elements:\n  - name: /log/d\n    enabled: true\n    divider: 45Hz\n")
    logger.load_script(script)
    told = [record.getMessage() for record in caplog.records if "became" in record.getMessage()]
    assert told == [
        "element '/log/a': divider=30Hz became 3: 33.33 Hz of 100 Hz",
        "element '/log/b': divider=80Hz became 1: 100 Hz of 100 Hz",
        f"{script}:4: element '/log/d': divider=45Hz became 2: 50 Hz of 100 Hz",
    ]


def test_a_name_with_a_blank_is_told_of_as_other_readers_read_no_file_that_has_it(new_logger, caplog):
    logger = new_logger()
    logger.array("my signal")
    logger.array("mine")
    (told,) = [record.getMessage() for record in caplog.records if "blank" in record.getMessage()]
    assert "'/log/my signal'" in told
    assert "write '/log/my_signal'" in told


def test_what_is_asked_of_all_is_of_what_was_just_added_too(new_logger, tmp_path, caplog):
    script = tmp_path / "own.yaml"
    script.write_text("log_elements:\n  - {name: /log/x, divider: 3}\n")

    def added():
        log = new_logger("bot", frequency=100, script=script)
        log.array("x")
        log.array("y")
        return log

    def options(log):
        return [(info.options.divider, info.options.buffer.name) for info in log.elements]

    log = added()
    assert log.set(buffer="growing") == 2
    assert log.set("y", divider=7) == 1
    log.start()
    assert options(log) == [(3, "GROWING"), (7, "GROWING")]
    log.array("late")
    log.stop()
    assert log.set(divider=2) == 3

    other = tmp_path / "other.yaml"
    other.write_text("log_elements:\n  - {name: /log/y, divider: 5}\n")
    log = added()
    assert log.load_script(other) == []
    log.start()
    assert [divider for divider, _ in options(log)] == [3, 5]

    log = added()
    text = script.read_text()
    script.write_text("log_elements:\n  - {name: /log/x, divider: nine}\n")
    with pytest.raises(ScriptError):
        log.load_script()
    script.write_text(text + "  - {name: /log/none}\n")
    caplog.clear()
    assert log.load_script() == ["/log/none"]
    assert caplog.text.count("no element '/log/none'") == 1, "it is read once"
    script.write_text(text)

    added().save_script()
    log = added()
    log.update()
    assert [divider for divider, _ in options(log)] == [3, 1], "the script has what it had"
