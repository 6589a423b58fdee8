"""All messages of JSON are looked at before a value is asked for."""

import json

from silo.files.others import json_text
from silo.files.others.topics import equal


def looked_at(rows):
    bad = []
    found = json_text.signals_of(lambda _: equal(list(enumerate(rows))), bad)
    return found, sorted((which.tolist(), why) for which, why in bad)


def test_keys_that_come_late_are_signals_too():
    rows = [json.dumps({"a": at, "b": {"c": at / 2, "e": [1, 2]}, "ok": at % 2 == 0}).encode() for at in range(2000)]
    rows[1500] = json.dumps({"a": 5, "late": 2**60}).encode()
    rows[700] = b'{"a": 1'
    (wanted, _, told), bad = looked_at(rows)
    types = {"/".join(one.name): (one.dtype, one.count) for one in wanted}
    assert types == {"a": ("i8", 0), "b/c": ("f8", 0), "b/e": ("i8", 2), "ok": ("b1", 0), "late": ("i8", 0)}
    assert not told
    assert [which for which, _ in bad] == [[700]]


def test_the_first_message_of_another_kind_is_the_first_whatever_its_size():
    rows = [b'{"a": 1}'] * 5 + [b'{"a": "text that is long"}', b'{"a": 1}', b'{"a": "x"}', b'{"a": 1}', b'{"a": "y"}']
    (_, _, told), _ = looked_at(rows)
    assert told == ["/a is a number, but a text in 3 messages, first in number 5: left out there"]
