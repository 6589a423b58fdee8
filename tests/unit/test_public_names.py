"""How much there is to remember: public names, members of classes; those of before are told of."""

import numpy as np
import pytest

import silo
from silo.core import calls
from silo.errors import UnknownNameError

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
    ],
)
def test_what_newcomers_guess_is_told_of_in_the_right_word(kind, name, words):
    with pytest.raises(UnknownNameError, match=words):
        getattr(kind, name)


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
