"""All messages of JSON are looked at: what each path holds as a rule is a signal."""

from silo.files.others import json_text
from silo.files.others.topics import equal


def looked_at(rows):
    bad = []
    found = json_text.signals_of(equal(list(enumerate(rows))), bad)
    return found, sorted((which.tolist(), why) for which, why in bad)


def test_lists_of_texts_and_of_truths_are_signals_and_lists_of_lists_are_none():
    rows = [
        b'{"on": [true, false], "names": ["a", "\xc3\xa9"], "mat": [[1, 2], [3, 4]], "both": ["a", 1]}',
        b'{"names": ["long"]}',
        b'{"on": [true], "names": []}',
    ]
    groups = list(equal(list(enumerate(rows))))
    wanted, left, told = json_text.signals_of(groups, [])
    assert [(one.name, one.dtype, one.count) for one in wanted] == [(("on",), "b1", 2), (("names",), "S", 2)]
    assert left == [("mat",), ("both",)]
    assert not told
    found = json_text.columns_of(wanted, groups, 3, [])
    names = [[b"a", "\u00e9".encode()], [b"long", b""], [b"", b""]]
    assert found["names",].tolist() == names
    assert found["on",].tolist() == [[True, False], [None, None], [True, None]]


def test_the_first_message_of_another_kind_is_the_first_whatever_its_size():
    rows = [b'{"a": 1}'] * 5 + [b'{"a": "text that is long"}', b'{"a": 1}', b'{"a": "x"}', b'{"a": 1}', b'{"a": "y"}']
    (_, _, told), _ = looked_at(rows)
    assert told == ["/a is a number, but a text in 3 messages, first in number 5: left out there"]
