"""Random recordings of every kind, type and shape, to each format and back: equal in all that its row promises."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from silo.analysis.compute.shapes import assembled
from silo.core.elements import BufferType, Entry
from silo.core.kinds import KINDS, index_suffixes, kind_given, struct_text, vector_at_position
from silo.core.recording import NO_FAILURES, Failures, RecordedElement, RecordedEntry, Recording
from silo.files.formats import FORMATS, Keeps, read_recording, writer_for

NUMBERS = ("<f8", "<f4", "<f2", "|i1", "<i2", "<i4", "<i8", "|u1", "<u2", "<u4", "<u8", "|b1")
TYPES = (*NUMBERS, "<f16", "<M8[ns]", "<M8[D]", "<m8[us]", "|S5", "<U4")
GIVEN = [name for kind in KINDS for name in kind.orders] + [
    vector_at_position("world", "base"),
    "components(FL_hip, knee)",
]
SHAPES = [(), (1,), (1, 3), (2,), (3,), (2, 2), (3, 1), (2, 1, 2)]
READ = [one for one in FORMATS if one.reader and one.writer]
LETTERS = st.text("aäΩ \"',#-b", max_size=4).map(lambda text: text.rstrip("-"))


@st.composite
def columns(draw, dtype, count):
    dtype = np.dtype(dtype)
    if dtype.kind in "SU":
        texts = draw(st.lists(LETTERS, min_size=count, max_size=count))
        # cut to five bytes, behind which a dash may have come to the end, where .silo can't tell it from its padding
        raw = [text.encode()[:5].decode(errors="ignore").rstrip("-").encode() for text in texts]
        return np.array(raw if dtype.kind == "S" else texts, dtype) if count else np.empty(0, dtype)
    raw = draw(st.binary(min_size=count * 8, max_size=count * 8))
    whole = np.frombuffer(raw, "<i8").copy()
    if dtype.kind == "b":
        return whole % 2 == 1
    if dtype.str == "<f16":
        return whole.astype(dtype) / 3
    if dtype.kind in "mM":
        return whole.view(dtype)
    raw_bytes = whole.view(np.uint8).reshape(count, 8)[:, : dtype.itemsize]
    made = np.ascontiguousarray(raw_bytes).view(dtype).reshape(count)
    if dtype.kind == "f" and count and draw(st.booleans()):
        # a signalling NaN with a sign and a number in it: a text can't hold it
        bits = np.dtype(f"<u{dtype.itemsize}")
        pattern = int(np.array([-np.inf], dtype).view(bits)[0]) + 3
        made.view(bits)[-1] = pattern
    return made


@st.composite
def elements(draw, name, ticks):
    divider = draw(st.integers(1, 4))
    due = list(range(0, ticks, divider))
    buffer_type = draw(st.sampled_from(list(BufferType)))
    size = draw(st.integers(1, 9))
    if buffer_type is not BufferType.GROWING:
        due = due[:size] if buffer_type is BufferType.FIXED else due[-size:]
    sort = draw(st.sampled_from(["kind", "array", "complex", "struct"]))
    dtype, text, labels = draw(st.sampled_from(TYPES)), "", None
    if sort == "kind":
        kind, layout = kind_given(draw(st.sampled_from(GIVEN)))
        kind_name, shape, suffixes = kind.name, (len(layout),), list(layout)
        types = [dtype] * len(suffixes)
    elif sort == "struct":
        fields = np.dtype([("a", "<f8"), ("b", dtype, (2,)), ("z", "<c8")])
        kind_name, shape, text = "struct", draw(st.sampled_from(SHAPES)), struct_text(fields)
        inner = [("_a", "<f8"), ("_b_0", dtype), ("_b_1", dtype), ("_z_real", "<f4"), ("_z_imag", "<f4")]
        pairs = [(head + tail, each) for head in index_suffixes(shape) for tail, each in inner]
        suffixes, types = [suffix for suffix, _ in pairs], [each for _, each in pairs]
    else:
        shape, kind_name = draw(st.sampled_from(SHAPES)), "array"
        tails = ("_real", "_imag") if sort == "complex" else ("",)
        dtype = draw(st.sampled_from(["<f4", "<f8"])) if sort == "complex" else dtype
        suffixes = [head + tail for head in index_suffixes(shape) for tail in tails]
        types = [dtype] * len(suffixes)
        labels = draw(st.sampled_from([None, {-1: 'Ω, "x"', 3: "Binary Data"}]))
    entries = tuple(
        RecordedEntry(f"{name}{suffix}", Entry(suffix, each, labels), draw(columns(each, len(due))))
        for suffix, each in zip(suffixes, types, strict=True)
    )
    return RecordedElement(
        name,
        draw(st.sampled_from(["-", "m/s²", 'a "b"'])),
        kind_name,
        shape,
        divider,
        buffer_type,
        due[0] if due else 0,
        entries,
        draw(st.sampled_from(["", "# Binary Data\n"])),
        draw(st.integers(0, 2)),
        text,
        draw(st.sampled_from([NO_FAILURES, Failures(1, ((3, 3),)), Failures(2**40, ((0, 7), (2**39, 2**41)))])),
    )


@st.composite
def logs(draw):
    ticks = draw(st.integers(0, 12))
    names = draw(st.lists(st.text('ab/ é,"', min_size=1, max_size=5), max_size=3, unique=True))
    made = [draw(elements(f"/log/{place}{name}", ticks)) for place, name in enumerate(names)]
    start, step = draw(st.sampled_from([0, 1_700_000_000_123_456_789])), draw(st.sampled_from([1, 2_500_001]))
    return Recording(
        draw(st.sampled_from(["robot", "Ω"])),
        start + np.arange(ticks, dtype=np.int64) * step,
        ticks,
        made,
        frequency_hz=draw(st.sampled_from([None, 400.0])),
        started_ns=draw(st.integers(0, 5)),
        warnings=draw(st.sampled_from([(), ("memory limit reached",)])),
    )


def plain(values):
    if values.dtype.kind == "U":
        values = np.char.encode(values, "utf-8")
    return values.tolist() if values.dtype.kind == "S" else values


def same_bits(before, after):
    before, after = plain(before), plain(after)
    return before == after if isinstance(before, list) else before.tobytes() == after.tobytes()


def same_values(before, after):
    before, after = plain(before), plain(after)
    if isinstance(before, list) or isinstance(after, list):
        return before == after
    if before.dtype.kind in "mM":
        before, after = before.view("<i8"), after.view("<i8")
    return np.array_equal(before, after.astype(before.dtype), equal_nan=before.dtype.kind == "f")


def entries_of(recording):
    return {entry.name: (element, entry) for element in recording.elements for entry in element.entries}


PROMISES = {
    Keeps.UNITS: lambda e: e.unit,
    Keeps.KINDS: lambda e: (e.name, e.kind, e.shape, e.dtype, [entry.entry.suffix for entry in e.entries]),
    Keeps.LABELS: lambda e: [entry.entry.labels for entry in e.entries],
    Keeps.DESCRIPTIONS: lambda e: e.description,
    Keeps.BUFFERS: lambda e: (e.buffer_type, e.lost, e.failures),
    Keeps.DTYPES: lambda e: [entry.entry.dtype for entry in e.entries],
}


@pytest.mark.slow
@pytest.mark.parametrize("one", READ, ids=lambda one: one.name)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(log=logs())
def test_a_format_keeps_what_its_row_promises(one, log):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x{one.ending}"
        writer_for(path)(log, path, None)
        again = read_recording(path)
        kept = [element for element in log.elements if element.count or Keeps.EMPTY in one.keeps]
        np.testing.assert_array_equal(again.time_ns, log.time_ns)
        before, after = entries_of(replace(log, elements=kept)), entries_of(again)
        assert list(after) == list(before)
        same = same_bits if Keeps.BITS in one.keeps else same_values
        for name, (element, entry) in before.items():
            narrow = entry.values.dtype == np.longdouble and Keeps.LONG not in one.keeps
            assert same(entry.values.astype("<f8") if narrow else entry.values, after[name][1].values), name
            assert after[name][0].stamp_indices.tolist() == element.stamp_indices.tolist()
            for promise, facts in PROMISES.items():
                if promise in one.keeps:
                    assert facts(after[name][0]) == facts(element)
        if Keeps.ABOUT in one.keeps:
            for name in ("logger", "prefix", "offset", "frequency_hz", "started_ns", "time_looping"):
                assert getattr(again, name) == getattr(log, name)
            assert tuple(again.warnings)[: len(log.warnings)] == log.warnings  # what it rounds may be told
        if Keeps.KINDS in one.keeps:
            for one_element, other in zip(kept, again.elements, strict=True):
                assert assembled(other).shape == assembled(one_element).shape
