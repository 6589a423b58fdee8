"""Words of files, robots and clients move no cursor: not in errors and warnings, and nowhere that a program prints."""

import io
import json
import sys

import click
import pytest

from silo.cli.common import show_json
from silo.errors import LogWarning, SaveError, SiloError, UnknownSignalError, UnsavedError
from silo.printing import PrintedStream, drawing, print_printable, printable, printable_lines
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, checked
from silo.state.requests import Hello

EVIL = "\x1b[31mE\x9b5m\u202eR\x07\r\U000e0001"
TOLD = r"\x1b[31mE\x9b5m\u202eR\x07\x0d\U000e0001"


def an_end(encoding: str = "utf-8") -> tuple[io.BytesIO, PrintedStream]:
    """A program's end, and what comes out there."""
    out = io.BytesIO()
    return out, PrintedStream(io.TextIOWrapper(out, encoding))


def test_control_characters_are_escapes_that_read_as_one_character() -> None:
    assert printable(f"q\n{EVIL}\tü") == rf"q\x0a{TOLD}\x09ü"
    assert printable_lines(f"q\n{EVIL}\tü") == f"q\n{TOLD}\tü"
    assert printable_lines("\udcff.csv\n") == "\\udcff.csv\n"


@pytest.mark.parametrize("kind", [SiloError, SaveError, UnknownSignalError, UnsavedError, LogWarning])
def test_an_error_that_repeats_a_word_moves_no_cursor(kind: type[Exception]) -> None:
    assert str(kind(f"no '{EVIL}':\n\tlook")) == f"no '{TOLD}':\n\tlook"
    assert str(kind()) == ""


def test_nor_does_what_a_robot_refuses() -> None:
    with pytest.raises(RequestRefusedError) as refused:
        checked(Hello(), Refused(RefusedWhy.FAILED, EVIL))
    assert str(refused.value) == TOLD


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
def test_all_that_a_program_prints_goes_through_one_place(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    out, end = an_end(encoding)
    monkeypatch.setattr(sys, "stdout", end)
    print(EVIL, "…")
    sys.stdout.writelines([EVIL, "\n"])
    click.echo(EVIL, color=True)
    sys.stdout.flush()
    assert out.getvalue().decode(end.encoding) in (f"{TOLD} {dots}\n{TOLD}\n{TOLD}\n" for dots in ("…", r"\u2026"))


def test_what_silo_draws_itself_and_bytes_stay_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    out, end = an_end()
    monkeypatch.setattr(sys, "stdout", end)
    click.echo("\x1b[31mred\x1b[0m", file=drawing(sys.stdout), color=True)
    click.echo(b"\x07")
    assert out.getvalue() == b"\x1b[31mred\x1b[0m\n\x07\n"


def test_a_program_has_both_its_ends_so_once_and_those_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = io.TextIOWrapper(io.BytesIO(), "utf-8")
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", plain)
    print_printable()
    first = sys.stderr
    print_printable()
    assert sys.stdout is None
    assert sys.stderr is first
    assert drawing(first) is plain


def test_json_stays_json_and_has_no_control_character(capsys: pytest.CaptureFixture[str]) -> None:
    show_json({EVIL: [EVIL, "ü", "\x7f\n"]})
    said = capsys.readouterr().out
    assert said.removesuffix("\n").isprintable()
    assert json.loads(said) == {EVIL: [EVIL, "ü", "\x7f\n"]}
    assert "ü" in said
