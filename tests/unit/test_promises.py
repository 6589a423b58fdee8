"""Every promise names tests that there are."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / ".docs" / "promises.md"
PROMISES = re.findall(r"^\| (P\d+) \| (.+?) \| (.+?) \|$", PAGE.read_text(), re.MULTILINE)
LOOSE = re.findall(r"^\| (N\d+) \|", PAGE.read_text(), re.MULTILINE)

FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef


@functools.cache
def named_in(file):
    """`test_name` and `Class::test_name` of a file."""
    names = set()
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, FUNCTIONS):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {
                f"{node.name}::{one.name}"
                for one in node.body
                if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)
            }
    return {name for name in names if name.rpartition("::")[2].startswith("test_")}


def test_promises_are_numbered_without_a_gap():
    assert [number for number, _, _ in PROMISES] == [f"P{place}" for place in range(1, len(PROMISES) + 1)]
    assert [*LOOSE] == [f"N{place}" for place in range(1, len(LOOSE) + 1)]
    assert len(PROMISES) > 20


@pytest.mark.parametrize(("number", "proofs"), [(number, proofs) for number, _, proofs in PROMISES])
def test_the_proofs_of_a_promise_are_there(number, proofs):
    named = re.findall(r"`(tests/[\w/]+\.py)::([\w:]+)`", proofs)
    assert named
    assert proofs.count("`") == 2 * len(named)
    assert [name for file, name in named if name not in named_in(ROOT / file)] == []
