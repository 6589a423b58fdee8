"""Whatever way entries are picked out of rows, they are what stands there byte by byte."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from silo.core.arrays.values import as_floats
from silo.core.elements import BufferType, ElementInfo, ElementOptions, Entry
from silo.history.picking import _why_missing
from silo.segment.layout import EntrySchema, RingSchema
from silo.segment.picking import STAMPS, Packer, RowPicker, shaped
from silo.segment.rows import Rows

LIVE = ElementInfo("/log/x", "m", "scalar", (), (Entry("", "<f8"),), ElementOptions())
OF_OTHERS = replace(LIVE, expression="x / 2", description="= x / 2 (off: no signal 'x' (of 2))")
TYPES = ("<f8", "<f4", "<i8", "<u2", "|i1", "|b1", "<c16", "|S5", "<U3", "<f2")


@dataclass(frozen=True)
class Case:
    """Entries of a ring, and rows of random bytes."""

    entries: list[EntrySchema]
    words: np.ndarray

    def value_of(self, row: int, entry: EntrySchema) -> bytes:
        """What stands there, little-endian."""
        size = np.dtype(entry.dtype).itemsize
        found = self.words[row].tobytes()[entry.offset : entry.offset + size]
        return np.frombuffer(found, np.dtype(entry.dtype).newbyteorder(">" if entry.swapped else "<")).astype(
            entry.dtype
        ).tobytes()  # fmt: skip


@st.composite
def cases(draw: st.DrawFn, types: tuple[str, ...] = TYPES) -> Case:
    entries, offset = [], 16
    for place in range(draw(st.integers(1, 6))):
        dtype = np.dtype(draw(st.sampled_from(types)))
        offset += draw(st.integers(0, 9))
        swapped = dtype.itemsize > 1 and dtype.kind != "S" and draw(st.booleans())
        entries.append(EntrySchema(Entry(f"_{place}", dtype.str), offset, swapped))
        offset += dtype.itemsize
    rows, words = draw(st.integers(0, 4)), -(-offset // 8) + draw(st.integers(0, 3))
    bits = np.random.default_rng(draw(st.integers(0, 2**32))).integers(0, 2, (rows, words * 8), np.uint8)
    return Case(draw(st.permutations(entries)), bits.view(np.uint64))


def _bytes_of(column: np.ndarray) -> list[bytes]:
    return [column[at : at + 1].tobytes() for at in range(len(column))]


def rows_of(case: Case, words: np.ndarray) -> Rows:
    ring = RingSchema(1, 1, BufferType.LOOPING, 100, case.words.shape[1], 0)
    return Rows(ring, 7, np.ascontiguousarray(case.words[:, words]))


@given(cases())
def test_a_column_of_the_words_that_were_read_is_what_stands_in_the_row(case: Case) -> None:
    picker = RowPicker(dict(enumerate(case.entries)))
    rows = rows_of(case, picker.words)
    for key, column in picker.columns(rows):
        assert column.dtype.isnative
        assert _bytes_of(column) == [case.value_of(row, case.entries[key]) for row in range(len(case.words))]


@given(cases())
def test_the_words_that_are_read_open_with_the_stamps_and_hold_each_entry_once(case: Case) -> None:
    wanted = {
        place
        for entry in case.entries
        for place in range(entry.offset // 8, (entry.offset + np.dtype(entry.dtype).itemsize - 1) // 8 + 1)
    }
    words = RowPicker(dict(enumerate(case.entries))).words
    assert words.tolist() == sorted({*STAMPS.tolist(), *wanted})


@given(cases())
def test_blocks_have_every_entry_once_with_its_values(case: Case) -> None:
    picker = RowPicker(dict(enumerate(case.entries)))
    seen = []
    for places, values in picker.blocks(rows_of(case, picker.words).words):
        for at, place in enumerate(places.tolist()):
            seen.append(place)
            expected = [case.value_of(row, case.entries[place]) for row in range(len(case.words))]
            assert _bytes_of(values[:, at]) == expected
    assert sorted(seen) == list(range(len(case.entries)))


@given(cases())
def test_packed_entries_lie_beside_one_another_little_endian(case: Case) -> None:
    made = Packer(case.entries, [entry.entry.suffix for entry in case.entries]).of(case.words)
    assert made.flags.owndata
    assert made.tobytes() == b"".join(
        case.value_of(row, entry) for row in range(len(case.words)) for entry in case.entries
    )


@given(cases(types=("<f8",)), st.booleans())
def test_entries_of_one_type_are_packed_as_a_matrix(case: Case, swapped: bool) -> None:
    # evenly spaced, as arrays are, and not
    entries = [EntrySchema(each.entry, 16 + 8 * at, swapped) for at, each in enumerate(case.entries)]
    words = np.zeros((3, 2 + len(entries)), np.uint64) + np.arange(3, dtype=np.uint64)[:, None]
    for some in (entries, case.entries):
        rows = words if some is entries else case.words
        made = Packer(some).of(rows)
        assert made.shape == (len(rows), len(some))
        assert shaped(made, (len(some), 1)).shape == (len(rows), len(some), 1)


@given(cases(types=("<f8", "<i8", "|b1")))
def test_numbers_are_integers_or_the_nearest_float_of_each_entry(case: Case) -> None:
    picker = RowPicker(dict(enumerate(case.entries)))
    rows = rows_of(case, picker.words)
    for key, column in picker.columns(rows):
        made = picker.numbers(rows)[key]
        large = column.dtype == np.uint64 and (column >= 2**63).any()
        assert made.dtype == (np.int64 if column.dtype.kind in "iu" and not large else np.float64)
        np.testing.assert_array_equal(made, as_floats(column) if made.dtype.kind == "f" else column.astype(np.int64))


@pytest.mark.parametrize(
    ("shape", "entries", "made"), [((), 1, ()), ((2, 2), 4, (2, 2)), ((3,), 4, (4,)), ((3,), 1, ())]
)
def test_samples_have_the_shape_of_their_element_where_it_fits(
    shape: tuple[int, ...], entries: int, made: tuple[int, ...]
) -> None:
    assert shaped(np.zeros((5, entries)), shape).shape == (5, *made)
    assert shaped(np.zeros((5, 4)), (2,), parts=True).dtype == np.complex128
    assert shaped(np.zeros((5, 4), "f2"), (2,), parts=True).shape == (5, 4)
    assert shaped(np.zeros((5, 3)), (2,), parts=True).shape == (5, 3)


@pytest.mark.parametrize(
    ("info", "schema", "why"),
    [
        (replace(LIVE, options=ElementOptions(enabled=False)), None, "it is off"),
        (replace(OF_OTHERS, options=ElementOptions(enabled=False)), None, "no signal 'x' (of 2)"),
        (LIVE, None, "nothing was logged yet"),
        (None, None, "nothing was logged yet"),
        (LIVE, "schema", "it is not in this recording, start again"),
    ],
)
def test_why_there_are_no_samples_of_a_name_is_said(info, schema, why):
    assert _why_missing("/log/x", SimpleNamespace(element={"/log/x": info}.get), schema) == why
