"""A condition over what is held of its signals: the moments that a file with all samples tells."""

import numpy as np
import pytest

from silo.core.conditions import Conditions, Derived
from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import ExpressionError
from silo_tui.model.samples.turning import samples_for, turned_true

TICKS, STEP_NS = 2000, 10_000_000
DERIVED = (Derived("/log/sum", "a + b"),)


def element(name, divider, *suffixes):
    entries = tuple(Entry(suffix, "<f8") for suffix in suffixes or ("",))
    options = ElementOptions(True, divider, Action.SAVE, BufferType.GROWING, TICKS)
    return ElementInfo(name, "-", "array" if suffixes else "scalar", (), entries, options)


INFOS = [element("/log/a", 1), element("/log/b", 3), element("/log/v", 2, "_x", "_y"), element("/log/far/a", 1)]


@pytest.fixture(scope="module")
def recording():
    found = []
    for number, info in enumerate(INFOS):
        ticks = np.arange(0, TICKS, info.options.divider)
        entries = [
            RecordedEntry(info.name + one.suffix, one, 2 * np.sin(ticks / (11 + 7 * number + 3 * at)))
            for at, one in enumerate(info.entries)
        ]
        found.append(
            RecordedElement(info.name, "-", info.kind, (), info.options.divider, BufferType.GROWING, 0, tuple(entries))
        )
    time_ns = 10**18 + np.arange(TICKS) * STEP_NS
    return Recording("bot", time_ns, TICKS, found, conditions=Conditions(DERIVED))


def held_of(recording, *names):
    entries = {
        one.name: (recording.time_ns[each.stamp_indices], one.values)
        for each in recording.elements
        for one in each.entries
    }
    return lambda name: entries[name] if name in names else None


@pytest.mark.parametrize(
    ("condition", "names"),
    [
        ("/log/a > 0.5", ["/log/a"]),
        ("/log/a > 0 and b < 0.2", ["/log/a", "/log/b"]),
        ("b > 0 and v_y < 0", ["/log/b", "/log/v_y"]),
        ("any(v > 1)", ["/log/v_x", "/log/v_y"]),
        ("sum > 1", ["/log/a", "/log/b"]),
        ("mean(/log/a, 0.2s) > 0", ["/log/a"]),
    ],
)
async def test_it_turns_true_where_a_file_says(recording, condition, names):
    found = samples_for(condition, INFOS, "/log", DERIVED, held_of(recording, *names))
    here, file = await turned_true(found, condition), await turned_true(recording, condition)
    assert here.fires == len(file.time_ns) > 1
    assert here.time_ns == file.time_ns
    assert (here.begin_ns, here.end_ns) == (recording.time_ns[0], found.elements[0].own_ns[-1])


@pytest.mark.parametrize(
    ("condition", "names"),
    [
        ("/log/a > 0 and b < 0.2", ["/log/a"]), ("any(v > 1)", ["/log/v_x"]), ("sum > 1", ["/log/sum", "/log/a"]),
    ],
)  # fmt: skip
def test_of_signals_that_are_not_all_held_nothing_is_told(recording, condition, names):
    assert samples_for(condition, INFOS, "/log", DERIVED, held_of(recording, *names)) is None


def test_a_mistake_is_told_with_its_place(recording):
    with pytest.raises(ExpressionError, match="torqe"):
        samples_for("torqe > 1", INFOS, "/log", DERIVED, held_of(recording))
