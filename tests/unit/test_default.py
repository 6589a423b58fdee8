"""One logger for the whole program, as functions of the module."""

import inspect

import numpy as np
import pytest

import silo
from silo.logger import default
from silo.logger.logger import Logger
from silo.logger.null import NullLogger


@pytest.fixture(autouse=True)
def fresh_default(monkeypatch):
    monkeypatch.setattr(default, "_default", NullLogger())
    monkeypatch.setattr(default, "_early", {})
    monkeypatch.setattr(default, "_told", set())
    yield
    silo.get_logger().close()


@pytest.fixture
def init(tmp_path):
    def make(name="program", **options):
        return silo.init(name, **{"folder": tmp_path, "script": tmp_path / "logger.yaml", **options})

    return make


def test_a_function_is_documented_as_the_method_that_it_calls():
    for name in ("add", "start", "save"):
        function, method = getattr(silo, name), getattr(Logger, name)
        assert function.__doc__ == f"`Logger.{name}` of the default logger.\n\n{inspect.getdoc(method)}"
        assert function.__qualname__ == name


def test_init_makes_the_logger_that_the_functions_use(init):
    log = init()
    q = silo.array("q", 2)
    silo.add(np.zeros(1), "x")
    silo.update()
    silo.start()
    q[:] = 1
    silo.collect()
    silo.stop()
    assert isinstance(log, Logger)
    assert log.ticks == 1
    assert [info.name for info in log.elements] == ["/log/q", "/log/x"]


def test_a_second_init_closes_the_first_logger(init):
    first = init()
    first.array("x")
    first.start()
    init("second")
    assert not first.is_running


def test_get_logger_is_the_default_logger_with_every_method(init):
    log = init()
    assert silo.get_logger() is log
    silo.array("x")
    silo.update()
    assert silo.get_logger().set("x", divider=2) == 1


def test_what_came_before_init_is_told_of(init, caplog):
    silo.get_logger()
    silo.add(np.zeros(1), "x")
    init()
    assert "silo.get_logger(), silo.add() before silo.init() went to a logger that does nothing" in caplog.text


def test_an_init_that_came_first_is_told_nothing(init, caplog):
    init()
    silo.add(np.zeros(1), "x")
    init()
    assert "does nothing" not in caplog.text


def test_the_functions_have_the_arguments_of_the_methods():
    assert str(inspect.signature(silo.add)) == str(inspect.signature(Logger.add)).replace("(self, ", "(")
    assert "frequency" in inspect.signature(silo.init).parameters


def test_each_function_hands_on_what_it_is_given_to_the_method_of_its_name(monkeypatch):
    names = sorted(set(default.__all__) & set(dir(Logger)))
    calls = {name: () if name == "collect" else ("a", "b") for name in names}
    heard = {}

    class Hearing:
        def __getattr__(self, name):
            return lambda *args: heard.update({name: args})

    monkeypatch.setattr(default, "_default", Hearing())
    for name, args in calls.items():
        getattr(silo, name)(*args)
    assert heard == calls
    assert {"collect", "mark", "record", "stop_recording"} <= set(names)
