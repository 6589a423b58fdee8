"""What a part of a page tells to type, typed: its commands, which must succeed, and its lines of Python."""

import re
import shlex
from pathlib import Path

from silo.cli.main import run

DOCS = Path(__file__).resolve().parents[1] / ".docs"


def carry_out(page: str, heading: str) -> None:
    """Run the blocks below a heading of a page, in the present folder."""
    part = (DOCS / page).read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    blocks = re.findall(r"```(bash|python)\n(.*?)```", part, re.S)
    assert {kind for kind, _ in blocks} == {"bash", "python"}
    names: dict[str, object] = {}
    for kind, text in blocks:
        if kind == "python":
            exec(text, names)
            continue
        for line in text.splitlines():
            assert run(shlex.split(line, comments=True)[1:]) == 0, line
