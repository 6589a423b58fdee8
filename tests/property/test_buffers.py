"""Random tables, random numbers of ticks: what the buffers hold is what the original's rules, in plain Python, say."""

import dataclasses
import shutil
import tempfile
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import silo
from silo.core.elements import Action, BufferType
from silo.core.runtime import shared_memory_root
from tests.examples import examples

pytestmark = pytest.mark.slow

LOOPING, FIXED, GROWING = BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING
STEP_NS = 1_000_003
START_NS = 1_700_000_000_123_456_789

PACKED = np.dtype([("a", "i1"), ("b", "<f8"), ("c", "<u2", (2,)), ("d", "S3"), ("e", [("f", "<f4"), ("g", "?")])])
PADDED = np.dtype([("a", "i1"), ("b", ">f8"), ("c", "<c8")], align=True)
SIMPLE = [
    *("?", "i1", "<i2", "<i4", "<i8", "u1", "<u2", "<u4", "<u8", "<f2", "<f4", "<f8", "<f16"),
    *(">f8", ">f4", ">i2", ">u8", "S1", "S5", "S8", "S13", "<U3", ">U2", "<M8[ns]", ">M8[us]", "<m8[ms]"),
    *("<c8", "<c16", ">c16", PACKED, PADDED),
]
SHAPES = [(), (1,), (2,), (3,), (2, 3), (3, 1, 2), (40,), (7, 1), (200,)]


@dataclass(frozen=True)
class Spec:
    """An element to be drawn."""

    dtype: str | np.dtype = "<f8"
    shape: tuple[int, ...] = ()
    layout: str = "plain"
    divider: int = 1
    buffer_type: BufferType = LOOPING
    size: int = 10
    action: Action = Action.SAVE
    enabled: bool = True


def specs(longest=40):
    return st.builds(
        Spec,
        dtype=st.sampled_from(SIMPLE),
        shape=st.sampled_from(SHAPES),
        layout=st.sampled_from(["plain", "arena", "reversed", "strided", "unaligned", "transposed", "broadcast"]),
        divider=st.sampled_from([1, 1, 1, 1, 3, 3, 3, 2, 4, 5, 7, 11]),
        buffer_type=st.sampled_from(list(BufferType)),
        size=st.integers(1, longest),
        action=st.sampled_from(list(Action)),
        enabled=st.sampled_from([True, True, True, False]),
    )


def make_array(spec, name, log):
    """The array that is logged, and the memory to fill (not the same where items overlap)."""
    dtype, shape = np.dtype(spec.dtype), spec.shape
    if spec.layout == "arena":
        array = log.array(name, shape, dtype, **options_of(spec))
        return array, array
    memory = array = np.zeros(shape, dtype)
    if spec.layout == "unaligned":
        raw = np.zeros(array.nbytes + 3, np.uint8)
        memory = array = np.ndarray(shape, dtype, raw.data, 3)
    elif shape and spec.layout == "reversed":
        array = memory[::-1]
    elif shape and spec.layout == "strided":
        memory = np.zeros((*shape[:-1], 3 * shape[-1]), dtype)
        array = memory[..., 1::3]
    elif spec.layout == "transposed":
        memory = np.zeros(shape[::-1], dtype)
        array = memory.T
    elif spec.layout == "broadcast":
        memory = np.zeros(shape[-1:], dtype)
        array = np.broadcast_to(memory, shape)
    log.add(array, name, **options_of(spec))
    return array, memory


def options_of(spec):
    return {
        "divider": spec.divider,
        "buffer": spec.buffer_type,
        "size": spec.size,
        "action": spec.action,
        "enabled": spec.enabled,
    }


def fill(array, rng):
    """Random bits in every item that is no padding; bool stays 0 or 1."""
    if array.dtype.fields is not None:
        for name in array.dtype.names:
            fill(array[name], rng)
        return
    size = array.dtype.itemsize
    bits = rng.integers(0, 2 if array.dtype.kind == "b" else 256, (*array.shape, size), np.uint8)
    flat = bits.reshape(-1, size).copy().view(array.dtype)
    array[...] = flat.reshape(array.shape)


def leaves(array):
    """The bytes of every scalar, little-endian, in the order of the file."""
    if array.dtype.fields is not None:
        items = [np.array(leaves(array[name]), object).reshape(array.size, -1) for name in array.dtype.names]
        return np.hstack(items).reshape(-1).tolist()
    if array.dtype.kind == "c":
        half = np.dtype(f"{array.dtype.byteorder}f{array.dtype.itemsize // 2}")
        parts = np.ascontiguousarray(array).reshape(-1).view(half)
        return leaves(parts)
    flat = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).reshape(-1)
    size = array.dtype.itemsize
    raw = flat.tobytes()
    return [raw[i * size : (i + 1) * size] for i in range(flat.size)]


@dataclass
class Model:
    """A logger by the original's rules, in lists."""

    specs: list[Spec]
    frequency: float
    max_time: float
    stamps: list[int] = field(default_factory=list)
    samples: list[list[tuple[int, list[bytes]]]] = field(default_factory=list)  # per element: (tick, values)
    read: list[int] = field(default_factory=list)
    stopped: bool = False

    def __post_init__(self):
        self.samples = [[] for _ in self.specs]
        self.read = [0 for _ in self.specs]

    def time_rule(self):
        enabled = [spec for spec in self.specs if spec.enabled]
        types = {spec.buffer_type for spec in enabled}
        if types == {LOOPING} or types == {FIXED}:
            return types.pop(), max(spec.divider * spec.size for spec in enabled)
        if self.max_time:
            return FIXED, round(self.max_time * self.frequency)
        return GROWING, None

    def collect(self, stamp, values):
        if self.stopped:
            return
        tick = len(self.stamps)
        self.stamps.append(stamp)
        for samples, spec, value in zip(self.samples, self.specs, values, strict=True):
            if spec.enabled and tick % spec.divider == 0:
                samples.append((tick, value))
        kind, size = self.time_rule()
        self.stopped = kind is FIXED and len(self.stamps) >= size

    def kept(self, place, since=0):
        spec, samples = self.specs[place], self.samples[place]
        if spec.buffer_type is FIXED:
            return samples[since : spec.size]
        if spec.buffer_type is LOOPING:
            return samples[max(since, len(samples) - spec.size) :]
        return samples[since:]

    def kept_stamps(self):
        kind, size = self.time_rule()
        return self.stamps[-size:] if kind is LOOPING else self.stamps

    def read_new(self, place):
        """Values that are new, and how many were overwritten before they were read."""
        spec, since = self.specs[place], self.read[place]
        due = len(self.samples[place])
        self.read[place] = max(since, min(due, spec.size) if spec.buffer_type is FIXED else due)
        kept = self.kept(place, since)
        return kept, self.read[place] - since - len(kept)


def check_snapshot(recording, model):
    stamps = model.kept_stamps()
    assert recording.time_ns.tolist() == stamps
    assert recording.offset == len(model.stamps)
    expected = {
        f"/log/e{place}": model.kept(place)
        for place, spec in enumerate(model.specs)
        if spec.enabled and spec.action.saves and model.kept(place)
    }
    assert [element.name for element in recording.elements] == list(expected)
    gone = len(model.stamps) - len(stamps)
    for element in recording.elements:
        kept = expected[element.name]
        assert element.count == len(kept)
        assert (element.stamp_indices + gone).tolist() == [tick for tick, _ in kept]
        for place, entry in enumerate(element.entries):
            assert entry.values.dtype.str == entry.entry.dtype
            assert raw(entry.values) == [values[place] for _, values in kept]


def raw(values):
    size = values.dtype.itemsize
    data = np.ascontiguousarray(values).tobytes()
    return [data[i * size : (i + 1) * size] for i in range(len(values))]


def check_new_values(log, model, place):
    spec = model.specs[place]
    if not spec.enabled:
        return
    kept, missed = model.read_new(place)
    new = log.read_new_values(f"e{place}")
    assert new.missed == missed
    assert new.time_ns.tolist() == [model.stamps[tick] for tick, _ in kept]
    assert len(new.values) == len(kept)
    if new.values.dtype.fields is None:
        assert np.ascontiguousarray(new.values).tobytes() == b"".join(b"".join(values) for _, values in kept)
    else:
        packed = [raw(new.values[name]) for name in new.values.dtype.names]
        assert [list(row) for row in zip(*packed, strict=True)] == [values for _, values in kept]


steps = st.lists(st.tuples(st.integers(0, 60), st.booleans()), min_size=1, max_size=4)


@settings(max_examples=examples(120))
@given(
    table=st.lists(specs(), min_size=1, max_size=9),
    steps=steps,
    frequency=st.sampled_from([10.0, 30.0, 100.0]),
    max_time=st.sampled_from([0.0, 0.0, 0.1, 1.0, 5.0]),
    tiers=st.sampled_from([1, 1, 2, 3, 4]),
    checked=st.sampled_from([False, False, False, True]),
    seed=st.integers(0, 2**32),
)
@example([Spec(buffer_type=GROWING), Spec(divider=3)], [(100, True)], 100.0, 0.0, 3, False, 1)
@example([Spec(buffer_type=FIXED, size=3), Spec(buffer_type=FIXED, size=5)], [(100, True)], 100.0, 0.0, 1, False, 1)
@example([Spec(size=9), Spec(size=4), Spec(size=6), Spec(buffer_type=GROWING)], [(30, True)], 100.0, 0.0, 1, False, 1)
@example([Spec(size=1, divider=7), Spec(size=40)], [(90, True)], 100.0, 0.0, 3, False, 1)
@example([Spec(divider=d) for d in (1, 2, 3, 4, 5, 7, 11)], [(60, True), (31, False)], 100.0, 0.0, 3, False, 1)
def test_the_buffers_hold_what_the_rules_of_the_original_say(table, steps, frequency, max_time, tiers, checked, seed):
    folder = tempfile.mkdtemp(dir=shared_memory_root())
    rng = np.random.default_rng(seed)
    now = iter(range(START_NS - STEP_NS, 2**63 - 1, STEP_NS))
    log = silo.Logger(
        "model",
        frequency=frequency,
        max_time=max_time,
        clock=lambda: next(now),
        size_tiers=tiers,
        checked=checked,
        folder=folder,
        script=f"{folder}/none.yaml",
    )
    try:
        arrays = [make_array(spec, f"e{place}", log) for place, spec in enumerate(table)]
        log.start()
        model = Model(table, frequency, max_time)
        stamp = START_NS
        for ticks, look in steps:
            for _ in range(ticks):
                for _, memory in arrays:
                    fill(memory, rng)
                log.collect()
                model.collect(stamp, [leaves(array) for array, _ in arrays])
                stamp += STEP_NS
            assert log.is_running is not model.stopped
            check_snapshot(log.snapshot(), model)
            for place in range(len(table)):
                if look:
                    check_new_values(log, model, place)
        assert sum(log[name].lost for name in log) == 0
    finally:
        log.close()
        shutil.rmtree(folder)


@settings(max_examples=examples(15))
@given(table=st.lists(specs(3000), min_size=1, max_size=4), seed=st.integers(0, 2**32))
def test_thousands_of_ticks_wrap_rings_and_fill_chunks_without_a_wrong_sample(table, seed):
    # wide rows, so that growing rings come to their second chunk of 1 MB soon
    wide = Spec("<f8", (40, 40), buffer_type=GROWING, size=20)
    table = [dataclasses.replace(spec, shape=(), dtype="<f8", layout="plain") for spec in table] + [wide]
    folder = tempfile.mkdtemp(dir=shared_memory_root())
    log = silo.Logger("model", frequency=50, max_time=0, folder=folder, script=f"{folder}/none.yaml")
    try:
        arrays = [make_array(spec, f"e{place}", log)[0] for place, spec in enumerate(table)]
        log.start()
        for tick in range(700):
            for array in arrays:
                array[...] = tick + seed % 1000
            log.collect()
        recording = log.snapshot()
        assert recording.offset == 700
        for element in recording.elements:
            ticks = recording.offset - len(recording.time_ns) + element.stamp_indices
            for entry in element.entries:
                assert np.array_equal(entry.values, ticks + float(seed % 1000))
    finally:
        log.close()
        shutil.rmtree(folder)
