"""The table of formats: whoever needs to know one asks there."""

import inspect
import sys
from pathlib import Path

import pytest

from silo.core.elements import FileType
from silo.errors import FileFormatError
from silo.files import formats
from silo.files.formats import FORMATS, SAVED, SAVED_NAMES, Format, file_type, format_of, read_recording, writer_for
from silo.files.silo.writer import write_silo

ROOT = Path(__file__).resolve().parents[2]


def test_no_ending_belongs_to_two_formats():
    endings = [ending for one in FORMATS for ending in one.endings]
    assert len(endings) == len(set(endings))


def test_every_file_type_is_saved_by_one_format():
    assert list(SAVED) == list(FileType)
    assert [file_type(name) for name in SAVED_NAMES] == list(FileType)


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
def test_a_format_says_where_its_functions_are(one):
    assert one.reader or one.writer
    if one.writer:
        assert list(inspect.signature(one.load_writer()).parameters)[:3] == ["recording", "path", "progress"]
    assert not one.reader or callable(one.load_reader())


@pytest.mark.parametrize("ending", [ending for one in FORMATS for ending in one.endings])
def test_an_ending_is_understood_in_any_case(ending):
    assert format_of(f"RUN{ending.upper()}") == format_of(f"run{ending}")


def test_a_name_without_ending_is_a_bag_folder():
    assert format_of("walk").folder


@pytest.mark.parametrize("name", ["log", "log.bin", "log.0001"])
def test_a_file_with_another_ending_is_known_by_its_first_bytes(name, plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/a")], 3), tmp_path / name)
    assert read_recording(tmp_path / name).elements[0].name == "/log/a"


def test_a_script_that_begins_with_a_hash_is_no_log(tmp_path):
    (tmp_path / "run.sh").write_text("#!/bin/sh\n")
    with pytest.raises(FileFormatError, match=r"doesn't read \.sh, only \.silo"):
        read_recording(tmp_path / "run.sh")


def test_a_new_row_is_all_that_a_format_needs_to_be_known(monkeypatch, plan, recorded, tmp_path):
    module = type(sys)("a_format_of_tomorrow")
    written = recorded([plan("/log/a")], 3)
    module.write = lambda recording, path, progress=None: path.write_text(recording.logger)
    module.read = lambda path: written
    monkeypatch.setitem(sys.modules, module.__name__, module)
    row = Format("tomorrow", (".tmw",), "", "a_format_of_tomorrow:write", reader="a_format_of_tomorrow:read")
    monkeypatch.setattr(formats, "FORMATS", (*FORMATS, row))
    writer_for(tmp_path / "x.tmw")(written, tmp_path / "x.tmw", None)
    assert (tmp_path / "x.tmw").read_text() == "robot"
    assert read_recording(tmp_path / "x.tmw") is written
    assert ".tmw" in formats.readable()
    assert ".tmw" in formats.writable()
