"""Decoders are made one after the other: msgspec ends a process of which two threads decode a class first."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import silo

_MANY_AT_ONCE = """
import sys, threading
import msgspec
from silo.decoding import converted, json_decoder, msgpack_decoder

sys.setswitchinterval(1e-6)
ways = (
    lambda kind: json_decoder(kind).decode(b'{"a": {"f1": 3}, "b": [{"f0": 1}]}').a.f1,
    lambda kind: msgpack_decoder(kind).decode(msgspec.msgpack.encode({"a": {"f1": 3}})).a.f1,
    lambda kind: converted({"a": {"f1": 3}}, kind).a.f1,
)
for number in range(400):
    inner = msgspec.defstruct("Inner", [(f"f{each}", int, 0) for each in range(20)])
    kind = msgspec.defstruct("Outer", [("a", inner), ("b", list[inner], msgspec.field(default_factory=list))])
    together, found = threading.Barrier(len(ways)), []
    def ask(way):
        together.wait()
        found.append(way(kind))
    threads = [threading.Thread(target=ask, args=(way,)) for way in ways]
    for thread in threads: thread.start()
    for thread in threads: thread.join()
    assert found == [3, 3, 3]
"""


@pytest.mark.slow
def test_threads_that_decode_a_class_for_the_first_time_at_once_have_it() -> None:
    done = subprocess.run([sys.executable, "-c", _MANY_AT_ONCE], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_decoders_are_made_there_alone() -> None:
    package = Path(silo.__file__).parent
    found = []
    for file in sorted([*package.rglob("*.py"), *(package.parent / "silo_tui").rglob("*.py")]):
        text = file.read_text()
        for node in ast.walk(ast.parse(text)) if "msgspec" in text else ():
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            typed = isinstance(node, ast.Call) and (any(each.arg == "type" for each in node.keywords))
            if called in ("msgspec.convert", "msgspec.json.Decoder", "msgspec.msgpack.Decoder") or (
                typed and called in ("msgspec.json.decode", "msgspec.msgpack.decode", "msgspec.yaml.decode")
            ):
                found.append(f"{file.relative_to(package.parent)}:{node.lineno}")
    assert {one.partition(":")[0] for one in found} == {"silo/decoding.py"}, found
