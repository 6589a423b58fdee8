"""What is said of an argument that can't be, word for word; and what passes as what it is taken for."""

import enum
from pathlib import Path

import numpy as np
import pytest

from silo.core import arguments
from silo.core.elements import Action
from silo.core.tuning.parameters import Wave
from silo.errors import ElementError

ODD = "\ud800"  # half a character: no file can hold it
LONG = "x" * 81


class Rank(enum.Enum):
    EITHER = "i_or_ii"


class Hostile:
    def __repr__(self):
        raise RuntimeError("no")


@pytest.mark.parametrize(
    ("check", "value", "more", "words"),
    [
        ("text", 5, ["f('x')"], "it must be a text, got 5 (int); write f('x')"),
        ("text", ODD, ["f('x')"], r"it must be a text of whole characters, got '\ud800', which no file can hold; "
                                  "write f('x')"),
        ("text", Hostile(), ["f('x')"], "it must be a text, got a Hostile (Hostile); write f('x')"),
        ("text", Action.SAVE, ["f('x')"], "it must be a text, got Action.SAVE (Action); write f('x')"),
        ("text", [LONG], ["f('x')"], f"it must be a text, got ['{'x' * 78}... (list); write f('x')"),
        ("line", "a\nb", ["f('x')"], r"it must be of printable characters, on one line, got 'a\nb'"),
        ("texts", "ab", ["f(['x'])"], "it must be a list of texts, got 'ab'; write f(['x'])"),
        ("texts", 5, ["f(['x'])"], "it must be a list of texts, got 5; write f(['x'])"),
        ("texts", ["a", 5], ["f(['x'])"], "each of it must be a text, got 5 (int); write f(['x'])"),
        ("path", 5, [], "it must be a path, got 5; write it='some/path'"),
        ("path", "", [], "it must be a path, got ''; write it='some/path'"),
        ("path", "a\0", [], r"it must be a path without NUL characters, got 'a\x00'"),
        ("path", f"a/{'x' * 256}", [],
         f"it must be a path of at most 4095 bytes, 255 in each name, got 'a/{'x' * 77}..."),
        ("path", "x/" * 2047 + "xx", [],
         f"it must be a path of at most 4095 bytes, 255 in each name, got '{'x/' * 39}x..."),
        ("real", 1000, [1, 1000, "Hz"], "it must be from 1 and below 1000 Hz, got 1000"),
        ("real", 10**400, [0, 9, ""], f"it must be from 0 and below 9, got 1{'0' * 79}..."),
        ("real", "2 hz", [1, 9, "Hz"], "it must be from 1 and below 9 Hz, got '2 hz'; write it=2"),
        ("real", "2ms", [1, 9, "Hz"], "it must be from 1 and below 9 Hz, got '2ms'"),
        ("real", True, [0, 9, "s of time"], "it must be from 0 and below 9 s of time, got True"),
        ("whole", 8, [1, 7], "it must be a whole number from 1 to 7, got 8"),
        ("whole", 3.0, [1, 7], "it must be a whole number from 1 to 7, got 3.0; write it=3"),
        ("whole", 9.0, [1, 7], "it must be a whole number from 1 to 7, got 9.0"),
        ("whole", 2.5, [1, 7], "it must be a whole number from 1 to 7, got 2.5"),
        ("whole", True, [0, 7], "it must be a whole number from 0 to 7, got True"),
        ("switch", 1, [], "it must be True or False, got 1"),
        ("word", "chrip", [Wave],
         "it must be 'chirp', 'multisine', 'prbs' or 'step', got 'chrip'; did you mean 'chirp'?"),
        ("word", Action.SAVE, [Wave], "it must be 'chirp', 'multisine', 'prbs' or 'step', got Action.SAVE"),
    ],
)  # fmt: skip
def test_what_an_argument_must_be_is_said_with_what_it_is(check, value, more, words):
    with pytest.raises(ElementError) as refused:
        getattr(arguments, check)("it", value, *more)
    assert str(refused.value) == words


@pytest.mark.parametrize(
    ("check", "value", "more", "taken"),
    [
        ("path", b"a/b", [], Path("a/b")), ("path", "~", [], Path.home()), ("path", "a/~", [], Path("a/~")),
        ("path", "x" * 255, [], Path("x" * 255)), ("path", "x/" * 2047 + "x", [], Path("x/" * 2047 + "x")),
        ("real", 1, [1, 9, ""], 1.0), ("real", np.float32(2), [1, 9, ""], 2.0),
        ("whole", 1, [1, 7], 1), ("whole", np.int8(7), [1, 7], 7), ("whole", np.array(3), [1, 7], 3),
        ("switch", np.False_, [], False), ("switch", True, [], True),
        ("word", " Chirp ", [Wave], Wave.CHIRP), ("word", "i-or-ii", [Rank], Rank.EITHER),
        ("word", Rank.EITHER, [Rank], Rank.EITHER),
    ],
)  # fmt: skip
def test_what_can_be_is_taken_as_what_it_is(check, value, more, taken):
    found = getattr(arguments, check)("it", value, *more)
    assert (found, type(found)) == (taken, type(taken))


def test_a_number_may_have_to_be_above_its_lower_end():
    with pytest.raises(ElementError, match=r"^it must be above 0 and below 9 s, got 0$"):
        arguments.real("it", 0, 0, 9, "s", include_low=False)


def test_more_than_an_identifier_is_told_to_be_written_as_a_number_alone():
    assert arguments.whole_hint("the divider", 3.0, 1, 7) == "; write 3"
