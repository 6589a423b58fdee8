"""An element is `log["q"]`: who writes `log.q`, or a name that there isn't, is told so."""

import numpy as np
import pytest

import silo
from silo.errors import ElementError, SiloError, UnknownNameError
from silo.logger.arguments.options import element_name
from silo.logger.null import NullLogger


def test_asking_for_an_attribute_of_an_elements_name_says_how_to_look_at_it(new_logger):
    logger = new_logger()
    logger.array("q", 3, group="joints")
    with pytest.raises(UnknownNameError, match=r"a logger has no 'q': its element is log\['/log/joints/q'\]") as raised:
        _ = logger.q
    assert isinstance(raised.value, AttributeError)
    assert not hasattr(logger, "q")
    assert "q" not in dir(logger)


@pytest.mark.parametrize("name", ["error", "status", "rate", "time", "mean", "data", "put", "wait", "marker", "shape"])
def test_an_element_goes_before_what_others_mean_by_its_name(new_logger, name):
    logger = new_logger()
    logger.array(name)
    with pytest.raises(UnknownNameError, match=rf"a logger has no '{name}': its element is log\['/log/{name}'\]"):
        getattr(logger, name)
    logger.start()
    logger.collect()
    with pytest.raises(UnknownNameError, match=rf"a log has no '{name}': the signal is log\['{name}'\]"):
        getattr(silo.Log(logger.snapshot()), name)


def test_another_logger_has_no_such_name_and_python_says_so(new_logger):
    new_logger("one").array("q_of_one", 3)
    with pytest.raises(AttributeError, match="'Logger' object has no attribute 'q_of_one'") as raised:
        _ = new_logger("other").q_of_one
    assert not isinstance(raised.value, SiloError)


@pytest.mark.parametrize("value", [1, 0.5, np.ones(3), "walk"])
def test_setting_an_attribute_of_an_elements_name_is_refused(new_logger, value):
    logger = new_logger()
    q = logger.array("q", 3)
    with pytest.raises(UnknownNameError, match=r"log\.q = \.\.\. would change nothing of the element log\['/log/q'\]"):
        logger.q = value
    assert (q.tolist(), "q" in vars(logger)) == ([0, 0, 0], False)


def test_the_array_itself_may_be_kept_there(new_logger):
    logger = new_logger()
    logger.q = logger.array("q", 3)
    logger.q[:] = 2
    logger.part = 5  # of a program's own
    assert (logger.q.tolist(), logger.part) == ([2, 2, 2], 5)


def test_a_logger_of_ones_own_logs_its_own_attributes(tmp_path):
    class Own(silo.Logger):
        def __init__(self):
            super().__init__("own", folder=tmp_path, script=tmp_path / "none.yaml")
            self.mode = 1
            self.add(self, "mode", attr="mode")

    with Own() as logger:
        logger.start()
        logger.mode = 2
        logger.collect()
        assert logger["mode"].newest == 2
        logger.close(discard=True)


def test_a_null_logger_invents_no_element():
    log = NullLogger()
    log.array("q", 3)
    assert log["q"].shape == (3,)
    with pytest.raises(ElementError, match="no element 'Q'; did you mean '/log/q'"):
        log["Q"]


def test_a_logger_that_is_made_needs_no_init(new_logger):
    with pytest.raises(
        UnknownNameError, match=r"a logger has no 'init': silo.init\('robot'\) makes the default logger"
    ):
        new_logger().init("robot")


# ------------------------------------------------------------------------------------- what a newcomer is told in time


def test_a_script_that_is_not_there_is_told_of_once(tmp_path, caplog):
    with silo.Logger("test", folder=tmp_path, script=tmp_path / "robot.yaml") as logger:
        logger.update()
        logger.update()
        logger.close()
    (record,) = caplog.records
    assert f"test: there is no script {tmp_path / 'robot.yaml'}" in record.getMessage()


def test_of_the_script_that_nobody_named_nothing_is_said(new_logger, caplog):
    new_logger().update()
    assert caplog.records == []


def test_what_became_of_a_rate_is_not_told_of_an_element_that_is_refused(new_logger, caplog):
    logger = new_logger()
    with pytest.raises(SiloError):
        logger.add([1, 2], "q", divider="30Hz")
    assert caplog.records == []
    logger.add(np.zeros(2), "q", divider="30Hz")
    assert any("divider=30Hz became 3" in record.getMessage() for record in caplog.records)


def test_buffers_that_take_gigabytes_are_told_of_when_they_are_set(new_logger, caplog):
    logger = new_logger()
    logger.array("q", 12)
    logger.array("n", 10, dtype="i4", size=1_000_000)
    logger.update()
    logger.set("q", size="10M")
    (record,) = caplog.records
    assert "the buffers take 1.0 GB from the next start on" in record.getMessage()
    assert "most: /log/q, 0.96 GB" in record.getMessage()
    caplog.clear()
    logger.set("q", size="10k")
    assert caplog.records == []


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("x", None, None), "log.add takes the variable first and its name second, got 'x' alone; write "
         'log.add(x, "x")'),
        (("my x", None, None), "log.add takes the variable first and its name second, got 'my x' alone; write "
         'log.add(variable, "my x")'),
        (("x", 3, None), "log.add takes the variable first and its name second, got 'x' and 3 (int); write "
         'log.add(x, "x")'),
        (([1.0], None, None), 'give the element a name: log.add(list, "name")'),
        ((lambda: 1, None, None), 'give the element a name: log.add(function, "name")'),
        (([1.0], " / ", None), "element name ' / ': write a name of more than blanks and '/'"),
    ],
)  # fmt: skip
def test_an_element_that_has_no_name_is_refused_with_what_to_write(given, words):
    with pytest.raises(ElementError) as caught:
        element_name(*given)
    assert str(caught.value) == words


@pytest.mark.parametrize(
    ("given", "name"),
    [(("x", "kp", None), "kp"), (("x", None, "legs.q"), "q"), ((abs, None, None), "abs"), ((abs, "", "a.b.c"), "c")],
)
def test_an_element_is_called_as_it_is_told_or_as_its_attribute_or_its_function(given, name):
    assert element_name(*given) == name


def test_a_component_goes_before_what_others_mean_by_its_name(new_logger):
    logger = new_logger()
    logger.array("v", 2, kind="components(t, turn)")
    logger.start()
    logger.collect()
    with pytest.raises(UnknownNameError, match=r"it is signal\['t'\]"):
        _ = silo.Log(logger.snapshot())["v"].t


def test_what_lists_the_names_of_a_thing_is_what_help_finds(new_logger):
    log = new_logger()
    log.array("q")
    log.update()
    for one, home in ((log["q"], "silo.types.LoggedElement"), (log.elements[0], "silo.types.ElementInfo")):
        with pytest.raises(UnknownNameError, match=rf"help\({home}\) lists what there is"):
            _ = one.zzz
