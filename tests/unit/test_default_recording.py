"""Endless recording by the functions of the module."""

import pytest

import silo
from silo.logger import default
from silo.logger.null import NullLogger


def test_record_is_that_of_the_default_logger(monkeypatch, tmp_path):
    monkeypatch.setattr(default, "_default", NullLogger())
    assert silo.record(name="walk") == "walk"
    with silo.init("program", folder=tmp_path, script=tmp_path / "none.yaml"):
        with pytest.raises(silo.StateError, match="serve"):
            silo.record(["*"])
        with pytest.raises(silo.StateError, match="serve"):
            silo.stop_recording()
