"""How much there is to remember: public names, members of classes; those of before are told of."""

import re
import subprocess
import sys

import numpy as np
import pytest

import silo
from silo.errors import UnknownNameError
from silo.logger.serving.serving import Serving

MOST = {silo.Logger: 32, silo.Client: 50, silo.Signal: 45}


def members(kind):
    return [name for name in dir(kind) if not name.startswith("_")]


def test_there_are_few_public_names_and_no_hidden_ones():
    assert len(silo.__all__) <= 45
    hidden = {*vars(silo.errors), *vars(silo.types), *silo._OTHERS, "cleanup"} - {*silo.__all__, *dir(silo)}
    assert [name for name in hidden if name.isidentifier() and hasattr(silo, name)] == []


@pytest.mark.parametrize("kind", MOST, ids=lambda kind: kind.__name__)
def test_a_class_has_few_members(kind):
    assert len(members(kind)) <= MOST[kind], members(kind)


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("SavedFile", "it is silo.types.SavedFile"),
        ("vector_at_position", "it is silo.types.vector_at_position"),
        ("UnsavedError", "it is silo.errors.UnsavedError"),
        ("cleanup", "did you mean 'silo.close'?"),
    ],
)
def test_a_public_name_of_before_is_refused_with_where_it_is_also_when_it_is_imported(name, way):
    with pytest.raises(UnknownNameError, match=re.escape(way)):
        getattr(silo, name)
    with pytest.raises(ImportError, match=re.escape(way)):
        exec(f"from silo import {name}")
    assert name not in dir(silo)


OF_0_1 = {
    silo.Logger: "cleanup element enable disable apply set_limits set_trigger remove_derived remove_limits "
    "remove_trigger source_failures lost state is_closed extras ignored revision segment_path problems abandon",
    silo.Client: "set_limits remove_limits set_trigger remove_trigger remove_derived hello identity measure try_now",
    silo.Signal: "average in_unit bounds numbers places span stamps step_ns",
}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in OF_0_1 for name in OF_0_1[kind].split()])
def test_a_member_of_before_is_refused_with_what_to_write(kind, name, new_logger):
    things = {
        silo.Logger: lambda: [new_logger(), silo.NullLogger()],
        silo.Client: lambda: [object.__new__(silo.Client)],
        silo.Signal: lambda: [silo.Signal("q", np.arange(3.0), np.arange(3))],
    }
    assert name not in dir(kind)
    for thing in things[kind]():
        with pytest.raises(UnknownNameError, match=f"has no '{name}': (it is|they are) "):
            getattr(thing, name)


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        (silo, "read_log", "did you mean 'silo.open_log'?"),
        (silo, "discover", "it is `silo ls` in a shell"),
        (silo.Signal("q", np.arange(3.0), np.arange(3)), "lowpass", "scipy.signal.sosfiltfilt"),
        (silo.Signal("q", np.arange(3.0), np.arange(3)), "last", r"it is \[-1\]"),
        (silo.NullLogger(), "set_divider", r"log.set\('x', divider=2\)"),
        (silo.NullLogger(), "param", "log.parameter"),
        (object.__new__(Serving), "url", "^serving has no 'url': `silo address LOGGER` in a shell prints it$"),
        (object.__new__(Serving), "stop", r"^serving has no 'stop': it is \.close\(\)$"),
    ],
)
def test_what_newcomers_guess_is_told_of_in_the_right_word(kind, name, words):
    with pytest.raises(UnknownNameError, match=words):
        getattr(kind, name)


@pytest.mark.slow
def test_a_logger_written_small_is_told_of():
    program = "import silo\ntry:\n    silo.logger('x')\nexcept silo.SiloError as error:\n    print(error)"
    said = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert "did you mean 'silo.Logger'?" in said


def test_none_in_place_of_what_was_set_forgets_it(new_logger):
    log = new_logger()
    log.add(np.zeros(2), "x")
    log.derive("twice", "x_0 * 2")
    log.limit("x", (0, 1, 2, 3))
    log.trigger("high", "x_0 > 1")
    log.limit("x", None)
    log.trigger("high", None)
    log.derive("twice", None)
    assert log._conditions.now == type(log._conditions.now)()


def test_an_element_knows_at_how_many_ticks_it_could_not_be_read(new_logger):
    log = new_logger()
    log.add(lambda: 1 / 0 if log.ticks else 1.0, "broken")
    log.start()
    for _ in range(5):
        log.collect()
    assert log["broken"].failures == 4
