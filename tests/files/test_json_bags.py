"""All messages of JSON are looked at, those that are like others by a decoder that knows no more than those."""

import json
import random

import pytest

from silo.files.others import json_text
from silo.files.others.topics import equal

KEYS = ["a", "b", "late", "n1", "n2", "", "\u00e9", 'with "quotes"', "back\\slash", "a/b", "nested"]
RARE = ["float", "text", "bool", "null", "list", "floats", "large", "huge", "odd", "texts", "words", "truths", "dict"]


def value(chance, depth=0):
    """Any value, mostly a number."""
    match chance.choice(["int"] * 6 + RARE):
        case "int":
            return chance.randrange(100)
        case "float":
            return chance.random()
        case "text":
            return chance.choice(["", "12", "\u00e9"])
        case "bool":
            return chance.random() < 0.5
        case "list":
            return [chance.randrange(5) for _ in range(chance.randrange(4))]
        case "floats":
            return [chance.random() for _ in range(chance.randrange(3))]
        case "large":
            return chance.choice([2**53 + 1, -(2**60), 2**63 - 1])
        case "huge":
            return chance.choice([2**63, 2**64, -(2**63) - 1, 10**400])
        case "odd":
            return chance.choice([float("nan"), float("inf")])
        case "texts":
            return ["x", 1]
        case "words":
            return [chance.choice(["", "a", "\u00e9"]) for _ in range(chance.randrange(3))]
        case "truths":
            return [chance.random() < 0.5 for _ in range(chance.randrange(1, 3))]
        case "dict" if depth < 3:
            return {key: value(chance, depth + 1) for key in chance.sample(KEYS, 2)}
    return None


def messages_of(seed):
    """Messages that are alike for a while, as those of a program are, and then are not."""
    chance = random.Random(seed)
    made = []
    for _ in range(chance.randrange(1, 4)):
        shape = {key: value(chance) for key in chance.sample(KEYS, chance.randrange(1, 5))}
        for _ in range(chance.randrange(1, 30)):
            row = {key: chance.randrange(9) if type(one) is int else one for key, one in shape.items()}
            if chance.random() < 0.1:
                row[chance.choice(KEYS)] = value(chance)
            if chance.random() < 0.1:
                row.pop(chance.choice(list(row)))
            made.append(json.dumps(row).encode() if chance.random() > 0.02 else b'{"a": 1')
    return made


def looked_at(rows):
    bad = []
    found = json_text.signals_of(lambda _: equal(list(enumerate(rows))), bad)
    return found, sorted((which.tolist(), why) for which, why in bad)


@pytest.mark.parametrize("seed", range(30))
def test_what_is_found_is_what_is_found_by_looking_at_each(seed, monkeypatch):
    for number in range(10):
        rows = messages_of(f"{seed} {number}")
        quickly = looked_at(rows)
        with monkeypatch.context() as each:
            each.setattr(json_text, "_MOST_DECODERS", -1)
            assert quickly == looked_at(rows)


def test_messages_that_are_like_others_are_not_walked_through(monkeypatch):
    rows = [json.dumps({"a": at, "b": {"c": at / 2, "e": [1, 2]}, "ok": at % 2 == 0}).encode() for at in range(2000)]
    rows[1500] = json.dumps({"a": 5, "late": 2**60}).encode()
    walks = []
    look = json_text._look

    def counted(found, path, *more):
        walks.extend([path] if not path else [])
        look(found, path, *more)

    monkeypatch.setattr(json_text, "_look", counted)
    (wanted, _, told), bad = looked_at(rows)
    assert [one.name for one in wanted] == [("a",), ("b", "c"), ("b", "e"), ("ok",), ("late",)]
    assert not told
    assert not bad
    assert len(walks) < 10


def test_lists_of_texts_and_of_truths_are_signals_and_lists_of_lists_are_none():
    rows = [
        b'{"on": [true, false], "names": ["a", "\xc3\xa9"], "mat": [[1, 2], [3, 4]], "both": ["a", 1]}',
        b'{"names": ["long"]}',
        b'{"on": [true], "names": []}',
    ]
    groups = list(equal(list(enumerate(rows))))
    wanted, left, told = json_text.signals_of(lambda _: groups, [])
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
