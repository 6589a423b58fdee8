"""A logger that does nothing can stand wherever a logger stands."""

import inspect

import numpy as np
import pytest

from silo.errors import ArgumentError
from silo.logger.logger import Logger
from silo.logger.null import NullLogger


def public(kind):
    return {name for name in dir(kind) if not name.startswith("_")}


METHODS = sorted(name for name in public(Logger) if callable(getattr(Logger, name)))


def test_it_has_every_public_name_of_a_logger():
    null = NullLogger()
    assert [name for name in public(Logger) if not hasattr(null, name)] == []


def test_it_has_no_public_name_that_a_logger_lacks(new_logger):
    logger = new_logger()
    assert [name for name in public(NullLogger()) if not hasattr(logger, name)] == []


@pytest.mark.parametrize("name", [*METHODS, "__init__"])
def test_its_methods_take_the_same_arguments(name):
    mine = inspect.signature(getattr(NullLogger, name)).parameters.values()
    theirs = inspect.signature(getattr(Logger, name)).parameters.values()
    assert [(p.name, p.kind, p.default) for p in mine] == [(p.name, p.kind, p.default) for p in theirs]


@pytest.mark.parametrize("name", [name for name in METHODS if name != "serve"])  # there it has a NullServing
def test_its_methods_take_and_return_the_same_types(name):
    mine, theirs = (inspect.signature(getattr(kind, name)) for kind in (NullLogger, Logger))
    assert [p.annotation for p in mine.parameters.values()] == [p.annotation for p in theirs.parameters.values()]
    assert mine.return_annotation == theirs.return_annotation


@pytest.mark.parametrize("name", sorted(public(Logger) - set(METHODS)))
def test_its_properties_are_of_the_same_type(name, new_logger):
    logger = new_logger()
    assert type(getattr(NullLogger(), name)) is type(getattr(logger, name))


def test_a_whole_program_runs_on_it(tmp_path):
    log = NullLogger("nothing", frequency=100)
    q = log.array("q", 3, unit="rad")
    log.add(np.zeros(2), "x", divider=2)
    log.update()
    with log.serve() as serving:
        log.start()
        log.collect()
        assert not serving.alive
    log.stop()
    assert log.set("x", divider=3) == 0
    assert log.save(["silo", "csv"]) == []
    assert log.snapshot().elements == ()
    assert len(log.read_new_values("q").values) == 0
    log.close()
    assert q.tolist() == [0, 0, 0]
    assert list(tmp_path.iterdir()) == []


def test_it_is_a_context_manager():
    with NullLogger() as log:
        log.collect()
    assert not log.is_running


@pytest.mark.parametrize("name", [name for name in METHODS if inspect.signature(getattr(Logger, name)).parameters])
def test_its_methods_tell_of_a_wrong_call_as_a_logger_does(name, new_logger):
    if name in ("collect", "mark"):  # the control loop's: nothing stands before them
        return
    told = []
    for logger in (NullLogger(), new_logger()):
        with pytest.raises(ArgumentError) as caught:
            getattr(logger, name)(*range(20))
        told.append(str(caught.value))
    assert told[0] == told[1]
    assert f"log.{name}() takes" in told[0]


def test_what_it_returns_is_of_the_type_that_a_logger_returns():
    null = NullLogger()
    assert (null.set("x"), null.remove("x")) == (0, 0)
    assert (null.load_script(), null.stop_recording(), null.record(name="walk")) == ([], "", "walk")
    assert null.load_script() is not null.load_script()
    assert [null.start(), null.trigger("fall", when="x > 1"), null.close(discard=True)] == [None] * 3
