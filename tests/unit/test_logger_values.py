"""What a logger gives away: new values, files."""

import numpy as np
import pytest

import silo
from silo.errors import ElementError, StateError
from silo.logger.run_data import RunData
from tests.stand_ins.ticking import collect

# ----------------------------------------------------------------------------------------------------- new values


def test_new_values_are_those_since_the_last_call(counting):
    logger = counting()
    collect(logger, 3)
    assert logger.read_new_values("x").values.tolist() == [0, 1, 2]
    collect(logger, 2)
    assert logger.read_new_values("x").values.tolist() == [3, 4]


def test_values_that_were_overwritten_before_they_were_read_are_counted(counting):
    logger = counting(size=5)
    collect(logger, 12)
    new = logger.read_new_values("x")
    assert (new.values.tolist(), new.missed) == ([7, 8, 9, 10, 11], 7)


def test_new_values_begin_anew_with_each_start(counting):
    logger = counting()
    collect(logger, 3)
    logger.read_new_values("x")
    logger.restart()
    collect(logger, 2)
    assert len(logger.read_new_values("x").values) == 2


def test_new_values_have_the_shape_of_the_variable(new_logger):
    logger = new_logger()
    logger.array("m", (2, 3))
    logger.start()
    collect(logger, 4)
    assert logger.read_new_values("m").values.shape == (4, 2, 3)


def test_new_values_of_mixed_types_have_a_field_per_suffix(new_logger):
    logger = new_logger()
    logger.add({"a": np.array([1.5]), "_a": np.array([7])}, "x")
    logger.start()
    logger.collect()
    new = logger.read_new_values("x").values
    assert new.dtype.names == ("a", "_a")
    assert new.tolist() == [(1.5, 7)]


def test_new_values_of_a_disabled_element_are_refused(counting):
    logger = counting(enabled=False)
    with pytest.raises(StateError, match="'/log/x' is not logged in this run: enable it and start again"):
        logger.read_new_values("x")


# --------------------------------------------------------------------------------------------------------- saving


def test_an_unknown_file_type_is_refused_with_those_that_there_are(counting):
    with pytest.raises(ElementError, match="unknown file type 'xls'; there are silo, csv and bag"):
        counting().save("xls")


def test_a_logger_has_no_hook_for_missing_names():
    # with one, Python looks `log.collect` up 8 ns slower in each tick
    assert not hasattr(silo.Logger, "__getattr__")


def test_a_start_of_another_thread_while_it_is_saved_takes_nothing_from_under_it(counting, monkeypatch):
    logger = counting()
    collect(logger, 5)
    asked = RunData._saved_by_helper

    def and_another_starts(*arguments):
        logger.stop()
        logger.start(unsaved="clear")  # the other thread, at this very moment
        collect(logger, 2)
        return asked(*arguments)

    monkeypatch.setattr(RunData, "_saved_by_helper", and_another_starts)
    (file,) = logger.save()
    assert len(silo.open_log(file.path).recording.time_ns) == 2
    assert not logger.has_unsaved
