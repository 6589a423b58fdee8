"""How much there is to remember: public names, members of classes; those of before work for one release."""

import numpy as np
import pytest

import silo
from silo.analysis.signal import FORMER as FORMER_OF_SIGNALS
from silo.core import calls
from silo.logger.arguments.other_names import FORMER

MOST = {silo.Logger: 32, silo.Client: 50, silo.Signal: 45}


@pytest.fixture(autouse=True)
def untold(monkeypatch):
    monkeypatch.setattr(calls, "_told_words", set())


def members(kind):
    return [name for name in dir(kind) if not name.startswith("_")]


def test_there_are_few_public_names():
    assert len(silo.__all__) <= 45


@pytest.mark.parametrize("kind", MOST, ids=lambda kind: kind.__name__)
def test_a_class_has_few_members(kind):
    assert len(members(kind)) <= MOST[kind], members(kind)


@pytest.mark.parametrize("name", ["SavedFile", "Serving", "SegmentError", "ExpressionError", "UnknownSignalError"])
def test_a_public_name_of_before_works_and_says_once_where_it_is(name, caplog):
    home = silo.errors if name.endswith("Error") else silo.types
    assert getattr(silo, name) is getattr(silo, name) is getattr(home, name)
    assert caplog.messages == [f"silo.{name} is {home.__name__}.{name} now; the next release will refuse silo.{name}"]
    assert name not in dir(silo)


@pytest.mark.parametrize("name", FORMER)
def test_a_member_of_before_works_and_says_once_what_to_write(name, new_logger, caplog):
    for log in (new_logger(), silo.NullLogger()):
        calls._told_words.clear()
        caplog.clear()
        assert name not in dir(log)
        getattr(log, name)
        getattr(log, name)
        assert [words for words in caplog.messages if f"log.{name} is " in words] == caplog.messages
        assert len(caplog.messages) == 1


@pytest.mark.parametrize("name", FORMER_OF_SIGNALS)
def test_a_signals_member_of_before_works_and_says_once_what_to_write(name, caplog):
    q = silo.Signal("q", np.arange(3.0), np.arange(3))
    getattr(q, name)
    getattr(q, name)
    assert len(caplog.messages) == 1
    assert f"signal.{name} is " in caplog.text


def test_members_of_before_do_what_they_did(new_logger):
    log = new_logger()
    log.add(np.zeros(2), "x")
    log.update()
    assert (log.disable("x"), log.enable("x"), log.element("x").options.enabled) == (1, 1, True)
    log.limit("x", (0, 1, 2, 3))
    log.trigger("high", "x_0 > 1", armed=False)
    log.remove_limits("x")
    log.remove_trigger("high")
    assert (log._extras.limits, log._extras.triggers, log.state.value, log.is_closed) == ((), (), "stopped", False)


def test_none_in_place_of_what_was_set_forgets_it(new_logger):
    log = new_logger()
    log.add(np.zeros(2), "x")
    log.derive("twice", "x_0 * 2")
    log.limit("x", (0, 1, 2, 3))
    log.trigger("high", "x_0 > 1")
    log.limit("x", None)
    log.trigger("high", None)
    log.derive("twice", None)
    assert log._extras == type(log._extras)()


def test_an_element_knows_at_how_many_ticks_it_could_not_be_read(new_logger):
    log = new_logger()
    log.add(lambda: 1 / 0 if log.ticks else 1.0, "broken")
    log.start()
    for _ in range(5):
        log.collect()
    assert log["broken"].failures == 4
