"""Keys as a terminal sends them: Esc is one of its own, whatever comes in one piece with it."""

import pytest
from textual import events

from silo_tui.terminal.answers import AnswerFilter, KeyReader


def keys_of(*reads: bytes) -> list[str]:
    """Return the keys of what is read; after the last read nothing comes any more."""
    answers, keys, found = AnswerFilter(), KeyReader(), []
    for each in reads:
        found += keys.feed(answers.feed(each).typed.decode())
    found += keys.feed(answers.waited().decode())
    if keys._parser._timeout_time is not None:
        keys._parser._timeout_time = 0.0  # so long ago
    found += keys.tick()
    return [each.key for each in found if isinstance(each, events.Key)]


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        (b"\x1bt", ["escape", "t"]),
        (b"\x1btjj", ["escape", "t", "j", "j"]),
        (b"o\x1bt", ["o", "escape", "t"]),
        (b"\x1bB", ["escape", "B"]),
        (b"\x1b?", ["escape", "question_mark"]),
        (b"\x1b]", ["escape", "right_square_bracket"]),
        (b"\x1b\x1b", ["escape", "escape"]),
        (b"\x1b\x1bx", ["escape", "escape", "x"]),
        (b"\x1b\r", ["escape", "enter"]),
        (b"\x1b\x1b[A", ["escape", "up"]),
        (b"\x1b[A\x1bj", ["up", "escape", "j"]),
        (b"\x1bO", ["escape", "O"]),
        (b"\x1b[", ["escape", "left_square_bracket"]),
        (b"\x1b", ["escape"]),
        (b"\x1bb\x1bf", ["escape", "b", "escape", "f"]),
        (b"\x1bOP", ["f1"]),
        (b"\x1b[1;2D", ["shift+left"]),
        (b"\x1b\xc3\xa4", ["escape", "\u00e4"]),
    ],
)
def test_escape_and_a_letter_in_one_read_are_two_keys(typed, keys):
    assert keys_of(typed) == keys


def test_a_sequence_that_comes_in_pieces_is_one_key():
    assert keys_of(b"\x1b", b"[A") == ["up"]
    assert keys_of(b"\x1b[1;", b"2D") == ["shift+left"]


def test_what_is_pasted_is_no_key():
    found = list(KeyReader().feed("\x1b[200~a [O t b\x1b[201~\x1bx"))
    assert [each.text for each in found if isinstance(each, events.Paste)] == ["a [O t b"]
    assert [each.key for each in found if isinstance(each, events.Key)] == ["escape", "x"]
