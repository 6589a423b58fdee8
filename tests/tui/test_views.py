"""Views: what is on the screen is kept by a name and put on it again, on another robot as far as it has it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo_tui.layouts import files
from silo_tui.layouts.layout import FIELDS, Layout, read, write
from silo_tui.layouts.views import capture
from silo_tui.screens.monitor import MonitorScreen
from silo_tui.screens.table import TableScreen
from silo_tui.settings.options import Settings


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return tmp_path / "silo"


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
    Layout,
    sort=names, filter=names, columns=st.lists(names, unique=True, max_size=3).map(tuple),
    plots=panels, chosen=names,
    span_s=st.floats(1e-3, 1e6),
    scales=st.dictionaries(names, st.tuples(numbers, numbers).filter(lambda ends: ends[0] < ends[1]), max_size=2),
)  # fmt: skip


@settings(max_examples=80, deadline=None)
@given(layouts)
def test_what_is_written_is_read_again(layout):
    found, problems = read(write(layout))
    assert not problems
    assert found == layout


MISTAKES = [
    ("plts: [a]", "line 1: plts is unknown; plots?"), ("plots: a", "line 1: plots is a list such as [a, b], not a"),
    ("span_s: -1", "line 1: span_s is seconds above 0, not -1"), ("span_s: x", "span_s is a number, not x"),
    ("scales: {a: [2, 1]}", "scales is [bottom, top] for a, not a list"),
    ("filter: [a]", "filter is a text, not a list"), ("plots: [a", "line 1: not valid YAML"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "words"), MISTAKES)
def test_a_mistake_costs_its_line_and_is_told(line, words):
    found, problems = read(f"{line}\nsort: div\n")
    assert found == Layout(sort="div")
    assert words in problems[0]


def test_every_field_of_a_view_can_be_read():
    assert list(Layout.__dataclass_fields__) == list(FIELDS)


@pytest.mark.parametrize("name", ["", "a/b", "../x", ".last-x", " a", "a" * 81, "-x\n"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="is no name for a view"):
        files.place(name)


async def run(screen, line):
    await screen.press("colon")
    await screen.type(line)
    await screen.press("enter")


async def test_a_view_is_kept_and_put_on_the_screen_again(new_fake, opened):
    fake, second = new_fake(), new_fake()
    fake.run()
    second.run()
    async with opened(fake) as screen:
        await run(screen, "sort div")
        await run(screen, "filter base")
        await screen.press("j", "space", "space", "m")
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        monitor = screen.app.screen
        await screen.press("minus", "j")
        await screen.until(lambda: monitor.stack.chosen > 0)
        kept = capture(screen.app.context)
        await run(screen, "view save walk")
        await screen.shows(f"view walk kept with {len(kept.plots)} plots")
        assert isinstance(screen.app.screen, MonitorScreen)
        assert kept.sort == "div"
        assert kept.filter == "base"
        assert kept.span_s == 20.0
        assert len(kept.plots) > 1
    async with opened(second, view="walk") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        assert capture(screen.app.context) == kept
        await screen.shows("view walk")


async def test_a_view_is_kept_by_its_word_and_listed(fake, opened):
    async with opened(fake) as screen:
        await run(screen, "sort size")
        await run(screen, "view save my view")
        await screen.shows("view my view kept")
        await run(screen, "sort name")
        await run(screen, "view")
        await screen.shows("views: my view")
        await run(screen, "view my view")
        await screen.until(lambda: screen.session.rows.sort == "size")


async def test_what_a_logger_doesnt_have_is_told_and_the_rest_is_shown(fake, opened):
    name = fake.table().elements[0].name
    entry = name + fake.table().elements[0].entries[0].suffix
    files.save(files.place("old"), Layout(sort="nope", plots=(("gone/x", entry),), columns=("div", "nope")))
    async with opened(fake, size=(160, 50), view="old") as screen:
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen))
        assert [plotted.name for plotted in screen.app.screen.stack.plots] == [entry]
        await screen.shows("not on this logger: order nope, column nope, 1 of 2 plots (gone/x)")


async def test_a_view_that_isnt_there_is_told_with_those_that_are(fake, opened):
    files.save(files.place("walk"), Layout())
    async with opened(fake, view="wlak") as screen:
        await screen.shows("there is no view 'wlak'; walk?")
        assert isinstance(screen.app.screen, TableScreen)


async def test_the_view_that_was_left_last_comes_back_if_wished(new_fake, opened):
    for wished, order in (("last", "div"), ("off", "name")):
        async with opened(new_fake(), settings=Settings(view="last")) as screen:
            await run(screen, "sort div")
            await screen.until(lambda: files.last_of(screen.session.name).exists(), "kept within a second")
            await screen.until(lambda: files.load_file(files.last_of(screen.session.name))[0].sort == "div")
        async with opened(new_fake(), settings=Settings(view=wished)) as screen:
            await screen.until(lambda order=order: screen.session.rows.sort == order)
    assert files.names() == []
