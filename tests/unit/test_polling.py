"""Waiting for descriptors, whatever their numbers."""

import ast
import os
import resource
from pathlib import Path

import pytest

import silo
from silo.polling import readable, writable


def test_descriptors_beyond_1023_are_waited_for():
    if resource.getrlimit(resource.RLIMIT_NOFILE)[0] < 2048:
        resource.setrlimit(resource.RLIMIT_NOFILE, (2048, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    reader, writer = os.pipe()
    far = os.dup2(reader, 1500)
    try:
        assert (readable(far, timeout_s=0), writable(writer, 0)) == ([], True)
        os.write(writer, b"x")
        assert readable(reader, far) == [reader, far]
    finally:
        for each in (far, reader, writer):
            os.close(each)
    with pytest.raises(OSError, match="Bad file descriptor"):
        readable(far, timeout_s=0)


def test_nothing_of_silo_waits_in_another_way():
    found = [
        path.name
        for path in Path(silo.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "select.select"
    ]
    assert found == []
