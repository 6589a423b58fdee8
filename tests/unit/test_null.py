"""A logger that does nothing can stand wherever a logger stands."""

import inspect

import numpy as np
import pytest

from silo.logger.logger import Logger
from silo.logger.null import NullLogger

INSIDE = {"lock", "after_fork_in_child", "problems", "present_run", "note_saved", "look_for_unheld"}  # for silo itself


def public(kind):
    return {name for name in dir(kind) if not name.startswith("_")} - INSIDE


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
