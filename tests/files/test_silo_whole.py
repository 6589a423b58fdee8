"""Whole files and repaired ones: what is read of a file is the same, and what does not fit is repaired."""

import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from silo.analysis.opening import open_log
from silo.files.silo import format as form
from silo.files.silo.reader import FileElements, read_silo
from silo.files.silo.writer import write_silo
from tests.examples import examples


def repaired(path):
    """What is read of a file in which header, facts and length disagree, by a byte that nobody announced."""
    path.write_bytes(path.read_bytes() + b"1")
    return read_silo(path)


def sealed(data):
    """The file with a checksum that fits its header, as after a change by somebody who knows the format."""
    end = data.index(b"\n# Binary Data\n") + len(b"\n# Binary Data\n")
    check = data.index(b"# silo check ")
    digits = b"%08x" % zlib.crc32(data[:check] + form.DATA_LINE)
    return data[: check + 13] + digits + data[check + 21 : end] + data[end:]


@settings(max_examples=examples(80), suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_what_is_read_of_a_whole_file_and_of_a_repaired_one_is_the_same(data, any_recording, bits_of, tmp_path_factory):
    recording = data.draw(any_recording())
    path = tmp_path_factory.mktemp("silo") / "x.silo"
    write_silo(recording, path)
    one, other = read_silo(path), repaired(path)
    assert other.warnings == (*one.warnings, "1 bytes after the last value are ignored")
    for name in ("logger", "offset", "prefix", "frequency_hz", "started_ns", "time_looping", "events"):
        assert getattr(one, name) == getattr(other, name)
    np.testing.assert_array_equal(one.time_ns, other.time_ns)
    assert len(one.elements) == len(other.elements)
    for mine, theirs in zip(one.elements, other.elements, strict=True):
        assert replace(mine, entries=()) == replace(theirs, entries=())
        assert [(e.name, e.entry) for e in mine.entries] == [(e.name, e.entry) for e in theirs.entries]
        assert [bits_of(e.values) for e in mine.entries] == [bits_of(e.values) for e in theirs.entries]


def test_an_element_is_made_when_it_is_asked_for_and_stays_the_same(plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/a"), plan("/log/v", kind="vector"), plan("/log/b")], 5), tmp_path / "x.silo")
    elements = read_silo(tmp_path / "x.silo").elements
    assert isinstance(elements, FileElements)
    assert elements.names == ["/log/a", "/log/v", "/log/b"]
    assert elements[1] is elements[-2] is elements[1:][0]
    assert [element.name for element in elements] == elements.names
    with pytest.raises(IndexError, match="the log has 3"):
        elements[3]


def test_elements_of_a_file_can_be_changed_like_any_other(plan, recorded, tmp_path):
    write_silo(recorded([plan("/log/a", "<i2")], 5), tmp_path / "x.silo")
    element = read_silo(tmp_path / "x.silo").elements[0]
    changed = replace(element, name="/b", entries=(replace(element.entries[0], name="/b"),))
    assert (changed.name, changed.entries[0].values.tolist()) == ("/b", element.entries[0].values.tolist())


def test_a_recording_of_a_file_can_be_changed_like_any_other(plan, recorded, tmp_path):
    recording = recorded([plan("/log/a")], 5)
    write_silo(recording, tmp_path / "x.silo")
    changed = replace(read_silo(tmp_path / "x.silo"), logger="b")
    assert (changed.logger, changed.time_ns.tolist()) == ("b", recording.time_ns.tolist())


def test_a_part_of_an_opened_log_has_its_times(plan, recorded, tmp_path):
    recording = recorded([plan("/log/arm/a"), plan("/log/leg/b")], 5)
    write_silo(recording, tmp_path / "x.silo")
    part = open_log(tmp_path / "x.silo").namespace("/log/leg")
    assert list(part) == ["/log/leg/b"]
    assert part["leg/b"].time_ns.tolist() == recording.time_ns.tolist()


CHANGES = {
    "another name in the table": (b"/log/a 8 5", b"/log/c 8 5"),
    "another type": (b"/log/a 8 5 1 1 double", b"/log/a 8 5 1 1 int64"),
    "a type that isn't": (b"/log/a 8 5 1 1 double", b"/log/a 8 5 1 1 dowble"),
    "samples without time stamps": (b"/log/a 8 5 1 1", b"/log/a 8 5 7 1"),
    "a divider of 0": (b"/log/a 8 5 1 1", b"/log/a 8 5 0 1"),
    "a looping flag of 2": (b"/log/a 8 5 1 1", b"/log/a 8 5 1 2"),
    "other time stamps": (b"time_ns 8 5", b"time_ns 4 5"),
    "another number of lines": (b"Elements: \n7\n", b"Elements: \n8\n"),
    "facts that are none": (b'# silo element {"name":"/log/a"', b'# silo element {"nome":"/log/a"'),
    "a byte that is no text": (b"/log/a 8 5", b"/log/\xff 8 5"),
}


# the table says what the values are called, and its checksum fits
SEEN_THROUGH = ("another name in the table", "a byte that is no text")


@pytest.mark.parametrize("change", CHANGES)
def test_a_header_that_is_not_as_silo_writes_it_is_repaired(change, plan, recorded, tmp_path):
    path = tmp_path / "x.silo"
    write_silo(recorded([plan("/log/a"), plan("/log/v", "<f4", "vector"), plan("/log/b")], 5), path)
    data = path.read_bytes()
    old, new = CHANGES[change]
    assert data.count(old) == 1
    path.write_bytes(sealed(data.replace(old, new)))
    found = read_silo(path)
    assert "/log/b" in [element.name for element in found.elements]
    assert len(found.elements) >= 2
    assert bool(found.warnings) is (change not in SEEN_THROUGH)


def test_a_file_with_bytes_more_or_less_is_told(plan, recorded, tmp_path):
    path = tmp_path / "x.silo"
    write_silo(recorded([plan("/log/a")], 5), path)
    data = path.read_bytes()
    for changed in (data + b"1", data[:-1], data[:-8]):
        path.write_bytes(changed)
        assert len(read_silo(path).warnings) == 1


def test_a_header_of_any_length_is_found(plan, recorded, tmp_path):
    path = tmp_path / "x.silo"
    for length in range(0, 64, 3):
        name = "/log/" + "a" * (65_536 // 3 - 420 + length)
        write_silo(recorded([plan(name)], 2), path)
        assert [element.name for element in read_silo(path).elements] == [name]
