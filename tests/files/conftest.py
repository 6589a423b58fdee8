"""Recordings as a logger makes them, of every type, divider and policy, and the rules for comparing them."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording

FIXTURES = Path(__file__).resolve().parents[2] / ".." / "shared" / "fixtures"

NUMBER_TYPES = ("<f8", "<f4", "|i1", "<i2", "<i4", "<i8", "|u1", "<u2", "<u4", "<u8", "|b1")
ODD_TYPES = ("<f2", "<f16", "<M8[ns]", "<m8[us]", "|S5", "<U4")
LAYOUTS = {
    "scalar": ((), ("",)),
    "vector": ((3,), ("_x", "_y", "_z")),
    "matrix": ((2, 3), tuple(f"_{r}_{c}" for r in range(2) for c in range(3))),
    "quaternion": ((4,), ("_x", "_y", "_z", "_w")),
    "complex": ((), ("_real", "_imag")),
}


class Plan:
    """An element that is to be recorded: what the table would say of it."""

    def __init__(self, name, dtype="<f8", kind="scalar", divider=1, buffer_type=BufferType.LOOPING, size=10, **more):
        self.name, self.dtype, self.kind = name, np.dtype(dtype), kind
        self.divider, self.buffer_type, self.size, self.more = divider, buffer_type, size, more

    def kept_ticks(self, ticks):
        due = list(range(0, ticks, self.divider))
        if self.buffer_type is BufferType.FIXED:
            return due[: self.size]
        return due[-self.size :] if self.buffer_type is BufferType.LOOPING else due


def make_values(dtype, count, rng):
    """`count` values of random bits, as a strided column of a row matrix (what a snapshot gives)."""
    words = -(-max(dtype.itemsize, 1) // 8) * 8
    rows = np.frombuffer(rng.randbytes(count * (words + 16)), np.uint8).reshape(count, words + 16).copy()
    if dtype.kind in "SU":
        letters = ["", "a", "-a", "Ωb", "a b", '"', "x,y"]
        texts = np.array([rng.choice(letters) for _ in range(count)], "U4")
        texts = np.char.encode(texts, "utf-8").astype(dtype) if dtype.kind == "S" else texts.astype(dtype)
        rows[:, 8 : 8 + dtype.itemsize] = texts.view(np.uint8).reshape(count, dtype.itemsize)
    if dtype.kind == "b":
        rows[:, 8] &= 1
    if dtype.str == "<f16":
        numbers = np.array([rng.uniform(-1e3, 1e3) for _ in range(count)], dtype) / 3
        rows[:, 8:24] = numbers.view(np.uint8).reshape(count, 16)
    field = np.dtype({"names": ["v"], "formats": [dtype], "offsets": [8], "itemsize": words + 16})
    return rows.reshape(-1).view(field)["v"] if count else np.empty(0, dtype)


def record(plans, ticks, *, seed=0, step_ns=2_000_000, start_ns=1_700_000_000_123_456_789, **more):
    """The recording of a run of so many ticks, as the segment's reader would give it."""
    rng = random.Random(seed)
    looping = bool(plans) and all(plan.buffer_type is BufferType.LOOPING for plan in plans)
    stamps = min(ticks, max(plan.divider * plan.size for plan in plans)) if looping else ticks
    elements = []
    for plan in plans:
        kept = plan.kept_ticks(ticks)
        shape, suffixes = LAYOUTS[plan.kind]
        entries = tuple(
            RecordedEntry(
                plan.name + suffix,
                Entry(suffix, plan.dtype.str, plan.more.get("labels")),
                make_values(plan.dtype, len(kept), rng),
            )
            for suffix in suffixes
        )
        elements.append(
            RecordedElement(
                name=plan.name,
                unit=plan.more.get("unit", "-"),
                kind=plan.kind,
                shape=shape,
                divider=plan.divider,
                buffer_type=plan.buffer_type,
                first=kept[0] - (ticks - stamps) if kept else 0,
                entries=entries,
                description=plan.more.get("description", ""),
                lost=plan.more.get("lost", 0),
            )
        )
    time_ns = start_ns + np.arange(ticks - stamps, ticks, dtype=np.int64) * step_ns
    return Recording("robot", time_ns, ticks, elements, time_looping=looping, **more)


@st.composite
def recordings(draw, types=NUMBER_TYPES + ODD_TYPES, kinds=tuple(LAYOUTS), names=None):
    """Any table of elements, dividers, policies and ticks."""
    names = names if names is not None else st.text(st.characters(codec="utf-8"), max_size=12)
    chosen = draw(st.lists(names, max_size=5, unique=True))
    plans = [
        Plan(
            f"/log/{name}:{number}" if number % 2 else f"{name}:{number}",
            draw(st.sampled_from(types)),
            draw(st.sampled_from(kinds)),
            draw(st.integers(1, 7)),
            draw(st.sampled_from(list(BufferType))),
            draw(st.integers(1, 12)),
            unit=draw(st.sampled_from(["-", "rad", "m/s²"])),
            labels=draw(st.sampled_from([None, {0: "STAND", -1: "Binary Data"}])),
            description=draw(st.sampled_from(["", '# Binary Data\nof the "left" leg'])),
            lost=draw(st.integers(0, 3)),
        )
        for number, name in enumerate(chosen)
    ]
    return record(
        plans,
        draw(st.integers(0, 60)),
        seed=draw(st.integers(0, 1000)),
        step_ns=draw(st.sampled_from([1, 2_000_000, 3_333_333_333])),
        start_ns=draw(st.sampled_from([0, -5_000_000_001, 1_700_000_000_123_456_789])),
        frequency_hz=draw(st.sampled_from([None, 500.0])),
        started_ns=draw(st.sampled_from([0, 1_700_000_000_000_000_000])),
        warnings=draw(st.sampled_from([(), ("memory limit reached",)])),
    )


def bits(values):
    """What must survive: every bit, of strings the text."""
    if values.dtype.kind == "U":
        values = np.char.encode(values, "utf-8")
    if values.dtype.kind == "S":
        return values.tolist()
    return np.ascontiguousarray(values).tobytes()


@pytest.fixture(scope="session")
def fixtures_folder() -> Path:
    """Files that the original wrote; tests that need them are skipped where they are missing."""
    if not FIXTURES.is_dir():
        pytest.skip("the files of the original are not here")
    return FIXTURES


@pytest.fixture(scope="session")
def any_recording() -> Callable[..., st.SearchStrategy[Recording]]:
    """The strategy `recordings`, to draw from."""
    return recordings


@pytest.fixture(scope="session")
def plan() -> type[Plan]:
    """`plan(name, dtype, kind, divider, buffer_type, size)`: an element to be recorded."""
    return Plan


@pytest.fixture(scope="session")
def recorded() -> Callable[..., Recording]:
    """`recorded(plans, ticks)`: what a logger would have recorded of them."""
    return record


@pytest.fixture(scope="session")
def bits_of() -> Callable[..., object]:
    """What of values must survive a round trip."""
    return bits
