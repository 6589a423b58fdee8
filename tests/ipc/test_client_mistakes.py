"""What a client is given by mistake is told of by errors of silo, and nothing happens."""

import pytest

from silo.client.client import Client
from silo.core.elements import FileType
from silo.errors import SiloError

MISTAKES = {
    "edits of a number": (lambda c: c.apply(5, 1), "edits must be a list"),
    "no edits": (lambda c: c.apply(None, -1), "edits must be a list"),
    "edits of text": (lambda c: c.apply("x", -1), "edits must be a list"),
    "an edit of text": (lambda c: c.apply(["x"], -1), "Expected `object`, got `str`"),
    "a revision beyond 64 bits": (lambda c: c.apply([], 10**30), "ApplyEdits can't be sent"),
    "history of a number": (lambda c: c.history(5, 1, 2, 3), "names must be a list of texts, got 5"),
    "history of one name": (lambda c: c.history("x", 0, 10, 1000), "names must be a list of texts, got 'x'"),
    "history beyond all time": (lambda c: c.history(["/log/x"], 0, 10**30, 1000), "GetHistory can't be sent"),
    "a script that is half a character": (lambda c: c.read_script("\ud800"), "ReadScript can't be sent"),
    "save a number": (lambda c: c.save(5), "unknown file type 5; there are silo, csv and bag"),
    "save None": (lambda c: c.save(None), "unknown file type None; there are"),
    "save by words": (lambda c: c.save(["cvs"]), "unknown file type 'cvs'; there are silo, csv and bag; did you mean"),
    "save under half a character": (lambda c: c.save([FileType.CSV], "\ud800"), "Save can't be sent"),
    "wait for a list": (lambda c: c.wait_saved([]), "job (the number that save() returned) must be"),
    "wait for text seconds": (lambda c: c.wait_saved(1, "a"), "timeout_s must be from 0"),
    "view a number": (lambda c: c.view(5), "values must be a list of texts"),
    "view one name": (lambda c: c.view("/log/x"), "values must be a list of texts, got '/log/x'"),
    "view None": (lambda c: c.view(None), "values must be a list of texts"),
    "columns beyond 64 bits": (lambda c: c.view([], [], 5, 10**30), "OpenView can't be sent"),
    "a keyword misspelt": (lambda c: c.save(type="csv"), "client.save() has no argument 'type', did you mean 'types'?"),
    "a topic that is not there": (lambda c: c.topic("/log/nope"), "has no element '/log/nope'; it has 8 elements"),
    "a topic misspelt": (lambda c: c.topic("matrx"), "did you mean '/log/matrix'?"),
    "a topic of a number": (lambda c: c.topic(5), "element must be a text"),
    "a topic of half a character": (lambda c: c.topic("\ud800"), "whole characters"),
}
NOBODY = {
    "a number": (lambda: Client.connect(5), "logger must be a text, got 5"),
    "no timeout": (lambda: Client.connect("bot", timeout_s=None), "timeout_s must be above 0"),
    "a text for a timeout": (lambda: Client.connect("bot", timeout_s="a"), "timeout_s must be above 0"),
    "a negative timeout": (lambda: Client.connect("bot", timeout_s=-1), "timeout_s must be above 0"),
    "a timeout of NaN": (lambda: Client.connect("bot", timeout_s=float("nan")), "timeout_s must be above 0"),
    "a number for a configuration": (lambda: Client.connect("bot", config=5), "config must be a text"),
}


def told(call, words):
    with pytest.raises(SiloError) as caught:
        call()
    assert words in str(caught.value)


def test_mistakes_are_told_of_and_the_client_goes_on(bench, client):
    for call, words in MISTAKES.values():
        told(lambda call=call: call(client), words)
    assert client.status().revision == bench.logger._table.revision


@pytest.mark.parametrize("mistake", NOBODY)
def test_who_is_no_logger_is_told_of_before_anybody_is_asked(mistake, runtime):
    told(*NOBODY[mistake])
