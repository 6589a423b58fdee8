"""What a view keeps, as its file says it: written, read again, and mistakes in it told."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo_tui.layouts import files
from silo_tui.layouts.layout import FIELDS, KeptLayout, read, write

names = st.text("aZé19 /_.:#-~*'\"[{,", max_size=12).map(str.strip)
numbers = st.floats(-1e12, 1e12)
# a signal stands in one plot
panels = st.lists(names.filter(bool), unique=True, max_size=6).flatmap(
    lambda given: st.lists(st.integers(1, 3), min_size=len(given), max_size=len(given)).map(
        lambda sizes: tuple(
            tuple(given[sum(sizes[:at]) : sum(sizes[: at + 1])])
            for at in range(len(sizes))
            if given[sum(sizes[:at]) : sum(sizes[: at + 1])]
        )
    )
)
layouts = st.builds(
    KeptLayout,
    sort=names, turned=st.booleans(), filter=names, set=names,
    folded=st.lists(names, unique=True, max_size=3).map(tuple),
    unfolded=st.lists(names, unique=True, max_size=3).map(tuple),
    components=st.dictionaries(names, names, max_size=2), columns=st.lists(names, unique=True, max_size=3).map(tuple),
    plots=panels, chosen=names,
    span_s=st.floats(1e-3, 1e6),
    scales=st.dictionaries(names, st.tuples(numbers, numbers).filter(lambda ends: ends[0] < ends[1]), max_size=2),
    logs=st.lists(names, unique=True, max_size=3).map(tuple),
)  # fmt: skip


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(layouts)
def test_what_is_written_is_read_again(layout):
    found, problems = read(write(layout))
    assert not problems
    assert found == layout


MISTAKES = [
    ("plts: [a]", "line 1: plts is unknown; did you mean 'plots'?"),
    ("plots: a", "line 1: plots is a list such as [a, b], not a"),
    ("span_s: -1", "line 1: span_s is seconds above 0, not -1"), ("span_s: x", "span_s is a number, not x"),
    ("scales: {a: [2, 1]}", "scales is [bottom, top] for a, not a list"),
    ("scales: {a: [1, 1]}", "scales is [bottom, top] for a"), ("scales: {a: [1]}", "scales is [bottom, top] for a"),
    ("scales: {a: [1, 2, 3]}", "scales is [bottom, top] for a"),
    ("filter: [a]", "filter is a text, not a list"), ("plots: [a", "line 1: not valid YAML"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "words"), MISTAKES)
def test_a_mistake_costs_its_line_and_is_told(line, words):
    found, problems = read(f"{line}\nsort: div\n")
    assert found == KeptLayout(sort="div")
    assert words in problems[0]


def test_every_field_of_a_view_can_be_read():
    assert list(KeptLayout.__dataclass_fields__) == list(FIELDS)


@pytest.mark.parametrize("name", ["", "a/b", "../x", ".last-x", " a", "a" * 81, "-x\n"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="is no name for a view"):
        files.place(name)
