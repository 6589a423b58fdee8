"""Options of an element have one word each; those of before are taken for one release, and the present one is told."""

import logging

import msgspec
import numpy as np
import pytest

import silo
from silo.core import calls
from silo.core.elements import DEFAULT_OPTIONS, ElementOptions
from silo.errors import ArgumentError, ElementError
from silo.settings.options import OPTIONS


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.setattr(calls, "_told_words", set())
    made = silo.Logger("words", frequency=100, folder=tmp_path, script=tmp_path / "words.yaml")
    yield made
    made.close()


def options_of(log, name="x"):
    log.update()
    return log[name].options


def told(caplog):
    return [record.getMessage() for record in caplog.records if "is called" in record.getMessage()]


NEW = {"buffer": "fixed", "size": "10s"}
FORMER = {"buffer_type": "fixed", "buffer_size": "10s"}


def adding(log, words):
    log.add(np.zeros(()), "x", **words)


def array(log, words):
    log.array("x", **words)


def setting(log, words):
    log.array("x")
    log.update()
    log.set("x", **words)


def editing(log, words):
    log.array("x")
    log.update()
    log._scripted.apply([silo.Edit("/log/x", **words)])


@pytest.mark.parametrize("door", [adding, array, setting, editing])
def test_every_door_takes_the_same_words_and_those_of_before_tell_them_once(log, door, caplog):
    with caplog.at_level(logging.WARNING, "silo"):
        door(log, NEW)
        wanted = options_of(log)
        assert (wanted.buffer, wanted.size, told(caplog)) == (silo.BufferType.FIXED, 1000, [])
        log.remove("x")
        door(log, FORMER)
        log.update()
        log.set("x", buffer_size="10s")
        assert options_of(log) == wanted
    assert len(told(caplog)) == 2
    assert told(caplog)[1] == "buffer_size is called size now: write size=...; the next release will refuse buffer_size"


def test_options_are_asked_and_made_by_both_words(log, caplog):
    options = ElementOptions(buffer_size=7, buffer_type=silo.BufferType.GROWING)
    assert (options.size, options.buffer_size, options.buffer_type) == (7, 7, silo.BufferType.GROWING)
    assert len(told(caplog)) == 2
    with pytest.raises(AttributeError, match="has no 'buffer_length'"):
        _ = options.buffer_length


def test_an_edit_says_what_is_to_change_and_leaves_the_rest(log):
    log.array("x", divider=4, action="both", size=30)
    log.update()
    assert log._scripted.apply([silo.Edit("/log/x", divider="*2")]) == 1
    assert options_of(log) == ElementOptions(True, 8, silo.Action.SAVE_AND_PUBLISH, silo.BufferType.LOOPING, 30)
    assert log._scripted.problems([silo.Edit("/log/nix", divider=2)])[0].reason == "the table has no such element"
    with pytest.raises(ElementError, match="divider must be a whole number from 1"):
        log._scripted.apply([silo.Edit("/log/x", divider=0)])


def test_an_edit_is_of_the_element_that_a_short_name_means(log):
    for name in ("leg/x", "arm/x", "x"):
        log.array(name)
    log.update()
    assert log._scripted.apply([silo.Edit("leg/x", divider=2), silo.Edit("x", DEFAULT_OPTIONS)]) >= 1
    assert [log[name].options.divider for name in ("leg/x", "arm/x")] == [2, 1]
    assert log["/log/x"].options == DEFAULT_OPTIONS, "its whole name is the prefix and this"
    log.remove("/log/x")
    with pytest.raises(ElementError, match="'x' means 2 elements, /log/leg/x, /log/arm/x: an edit is of one"):
        log._scripted.apply([silo.Edit("x", divider=2)])
    assert log._scripted.problems([silo.Edit("leg/*", divider=2)])[0].reason == "the table has no such element"


def test_a_rate_of_an_element_takes_kilohertz_as_that_of_its_logger_does(tmp_path):
    log = silo.Logger("bot", frequency="2kHz", folder=tmp_path)
    log.array("x", divider="1kHz")
    log.update()
    assert log["x"].options.divider == 2
    log.set("x", divider="0.5 khz")
    assert log["x"].options.divider == 4
    log.close()


def test_an_edit_takes_all_options_or_some(log):
    with pytest.raises(ArgumentError, match="got both"):
        silo.Edit("/log/x", DEFAULT_OPTIONS, divider=2)


def test_the_wire_has_the_names_that_it_had():
    assert list(msgspec.to_builtins(DEFAULT_OPTIONS)) == ["enabled", "divider", "action", "buffer_type", "buffer_size"]


def test_an_option_is_typed_by_its_name():
    assert all(option.keys[0] == option.name for option in OPTIONS)
    assert [option.name for option in OPTIONS] == list(ElementOptions.__struct_fields__)
