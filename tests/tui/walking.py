"""Walks through screens: after each step all that is shown, words and colours, is what it was before.

A walk is a file of `tests/data/walks`. Its first line names where it begins (a function of `tests.tui.test_walks`), the
size of the terminal, and settings. Each `==` is a step: ids of commands, keys, `"words` that are typed, or `wait`;
below it the lines that it changed, and the colours of those (`~`; letters with so many cells). What a letter stands for
is told at the end. `SILO_WRITE=1 pytest tests/tui/test_walks.py` walks the steps that stand there, and writes the rest
anew: so a new walk, or step, is written by hand without what it shows. Read the difference before you commit it.
"""

import os
import string
import time
from collections.abc import Sequence
from difflib import ndiff
from pathlib import Path
from typing import Any

from tests.waiting import DEADLINE_S

FOLDER = Path(__file__).parents[1] / "data" / "walks"
STEADY_LOOKS = 80  # a screen that is the same so often is what is written of a step: a survey comes once a second
LOOK_S = 0.02
Line = tuple[str, tuple[tuple[str, int], ...]]  # its words, and of how many cells each style is
STEP, LEGEND = "\n== ", "\n-- colours\n"


class Walk:
    """The steps of a file, and what each is to show."""

    def __init__(self, name: str) -> None:
        self._path = FOLDER / f"{name}.txt"
        whole, _, legend = self._path.read_text().rstrip("\n").partition(LEGEND)
        self.head, *self._expected = whole.split(STEP)
        self._legend = {style: letter for letter, _, style in (one.partition(" ") for one in legend.splitlines())}

    async def through(self, screen: Any) -> None:
        """Take all steps; raises AssertionError at the first that shows something else."""
        shown: list[Line] = []
        written = [self.head]
        if writes := bool(os.environ.get("SILO_WRITE")):
            self._legend = {}
        for expected in self._expected:
            steps = expected.partition("\n")[0]
            for one in steps.split(" | ") if steps != "wait" else ():
                await (screen.type(one[1:]) if one[0] == '"' else screen.do(one))
            same, before, deadline_s = 0, None, time.monotonic() + DEADLINE_S
            while same < STEADY_LOOKS or not writes:
                await screen.pilot.pause(LOOK_S if same else 0)
                now = [_line(segments) for segments in screen._lines()]
                told = "" if writes else self._told(steps, shown, now)
                if told == expected:
                    break
                assert time.monotonic() < deadline_s, "\n".join(ndiff(expected.splitlines(), told.splitlines()))
                same = same + 1 if now == before else 0
                before = now
            if writes:
                told = self._told(steps, shown, now)
            shown = now
            written.append(told)
        if writes:
            legend = [f"{letter} {style}" for style, letter in self._legend.items()]
            self._path.write_text(STEP.join(written) + LEGEND + "\n".join([*legend, ""]))

    def _told(self, steps: str, before: Sequence[Line], now: Sequence[Line]) -> str:
        lines = [steps]
        for place, (words, styles) in enumerate(now):
            known = before[place] if place < len(before) else ("", ())
            if words != known[0]:
                lines.append(f"{place:2}|{words}")
            if styles != known[1]:
                lines.append(f"{place:2}~{''.join(f'{self._letter(style)}{cells}' for style, cells in styles)}")
        return "\n".join(lines)

    def _letter(self, style: str) -> str:
        more, letter = divmod(len(self._legend), len(string.ascii_letters))
        return self._legend.setdefault(style, string.ascii_letters[letter] + "'" * more)


def _line(segments: Any) -> Line:
    words, runs = "", []
    for segment in segments:
        style = str(segment.style)
        cells = runs.pop()[1] if runs and runs[-1][0] == style else 0
        runs.append((style, cells + segment.cell_length))
        words += segment.text
    return words.replace("\xa0", " ").rstrip(), tuple(runs)
