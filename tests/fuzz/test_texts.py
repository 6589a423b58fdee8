"""Damaged texts that people write: scripts and `tui.yaml`. Only silo's own errors come out, and no memory is claimed.

The number of a failure makes it again.
"""

import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo.errors import SaveError, ScriptError
from silo.settings.script import apply_script, parse_script, write_script
from silo_tui.settings.reading import read
from silo_tui.settings.writing import rewritten
from tests.fuzz.test_files import little_room

WAYS = (
    "? [a, b]\n: c",
    "? {a: b}",
    "&a [*a]",
    "*a",
    "&a",
    "!!python/object:os.system",
    "- - - -",
    "{",
    "}",
    "[",
    "]",
    ": ",
    "\t",
    "'",
    '"',
    "|",
    ">-",
    "#",
    "---\n",
    "...\n",
    "~",
    "null",
    "no",
    "10m",
    "1e999",
    ".nan",
    "9" * 400,
    "0x1F",
    "010",
    "50Hz",
    "10s",
    "-",
    "\x00",
    '"\\ud800\\0"',
    "\u2028",
    "<<: ",
    "name: /log/x",
    "log_elements:",
    "triggers:",
    "keys:",
    "@",
    "%",
)
SCRIPT = """\
other: [1, {{deep: 2}}]
log_elements:
  - name: /log/x
    enabled: yes
    divider: 50Hz
    buffer: {{type: looping, size: 10s}}
    action: both
  - name: /log/q
    note: kept
derived_signals:
  - {{name: /log/d, expression: "x * q", unit: W, note: 3}}
signal_limits:
  - name: /log/q
    bounds: [null, -1, 2.5, {number}]
    when: "x > 1"
triggers:
  - name: fall
    when: "x > {number}"
    armed: no
    save: [silo, csv]
    later_silo:
      more: 3
"""
TUI = """\
# mine
theme: light
rate: {number}
mouse: off
columns: [div, size]   # all
keys:
  filter: [/, ctrl+f]
  sort: "O"
  help: F1
"""
TABLE = [
    ElementInfo(name, "-", "scalar", (), (Entry("", "<f8"),), ElementOptions(), "", "") for name in ("/log/x", "/log/q")
]


def damaged(text: str, rng: random.Random) -> str:
    """The text with one to six things wrong."""
    for _ in range(rng.randint(1, 6)):
        place, other = rng.randrange(len(text) + 1), rng.randrange(len(text) + 1)
        how = rng.randrange(7)
        if how == 0:
            text = text[:place] + rng.choice(WAYS) + text[place:]
        elif how == 1:
            text = text[:place] + text[place + rng.randint(1, 30) :]
        elif how == 2:
            text = text[:place] + text[other : other + rng.randint(1, 80)] + text[place:]
        elif how == 3:
            lines = text.split("\n")
            one, two = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[one], lines[two] = lines[two], " " * rng.randrange(6) + lines[one].lstrip()
            text = "\n".join(lines)
        elif how == 4:
            words = list(re.finditer(r"[\w/]+", text))
            found = rng.choice(words) if words else None
            text = text[: found.start()] + rng.choice(WAYS) + text[found.end() :] if found else text
        elif how == 5:
            values = list(re.finditer(r": .*", text))
            found = rng.choice(values) if values else None
            text = text[: found.start()] + ": " + rng.choice(WAYS) + text[found.end() :] if found else text
        else:
            text = text[:place] + chr(rng.choice((rng.randrange(128), rng.randrange(0x110000)))) + text[place:]
    return text


def look_at_script(text: str, folder: Path) -> None:
    """Read a script, apply it, write over it."""
    path = folder / "robot.yaml"
    path.write_bytes(text.encode())
    try:
        apply_script(parse_script(text, path), TABLE, 100.0)
    except ScriptError as error:
        assert "Expected `" not in str(error)  # msgspec's words
    write_script(path, TABLE)
    parse_script(path.read_text(), path)
    path.write_bytes(text.encode())
    write_script(path, TABLE, own=True)
    parse_script(path.read_text(), path)


def look_at_settings(text: str, folder: Path) -> None:
    """Read a settings file, which never fails, and change a line of it."""
    found, problems = read(text)
    assert all(problem.reason for problem in problems)
    try:
        rewritten(text, found, replace(found, theme="dark" if found.theme != "dark" else "light", keys={"help": "F2"}))
    except SaveError:
        return


LOOKS = {"script": (SCRIPT, look_at_script), "tui.yaml": (TUI, look_at_settings)}


def one(target: str, number: int) -> tuple[str, Callable[[str, Path], None]]:
    """The damaged text of this number, and who looks at it."""
    rng = random.Random(f"{target} {number}")
    text, look = LOOKS[target]
    # no file holds half of a pair
    return damaged(text.format(number=rng.randrange(100)), rng).encode("utf-8", "replace").decode(), look


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("target", LOOKS)
def test_of_a_damaged_text_come_only_errors_of_silo(target, numbers, tmp_path):
    raw = []
    for number in numbers:
        text, look = one(target, number)
        try:
            with little_room():
                look(text, tmp_path)
        except Exception as error:  # noqa: BLE001 - what must not come out
            raw.append(f"{target} {number}: {type(error).__name__}: {error}")
    assert raw[:20] == []
