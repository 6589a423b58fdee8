"""Every theme: text is told from its ground (WCAG contrast), and of the sixteen none that can't be seen is used."""

import re
from pathlib import Path

import pytest
from textual.color import Color

from silo_tui import theme
from silo_tui.commands.runner import CommandRunner
from silo_tui.settings.options import OPTION, Settings
from silo_tui.widgets.styled import _IN_16, _style

GROUNDS = ("background", "panel", "boost")
TEXTS = ("foreground", "quiet", "primary", "success", "plot", *theme.ROLES)
TRUE = [each for each in theme.THEMES if not each.ansi]


def luminance(color):
    parts = [part / 255 for part in Color.parse(color).rgb]
    r, g, b = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def value(of, role):
    return of.variables[role] if role in of.variables else getattr(of, role)


def test_the_ratio_is_that_of_the_standard():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("of", TRUE, ids=lambda each: each.name)
@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("role", TEXTS)
def test_text_is_told_from_its_ground(of, ground, role):
    least = 7 if of is theme.CONTRAST else 4.5
    assert contrast(value(of, role), value(of, ground)) >= least


@pytest.mark.parametrize("of", TRUE, ids=lambda each: each.name)
@pytest.mark.parametrize("role", [role for role in TEXTS if role != "quiet"])  # nothing is quiet under the cursor
def test_text_is_told_from_the_line_under_the_cursor(of, role):
    assert contrast(value(of, role), value(of, "line")) >= 4.5


@pytest.mark.parametrize("of", TRUE, ids=lambda each: each.name)
@pytest.mark.parametrize("ground", [*GROUNDS, "line"])  # a field that has the keys stands on the last
def test_what_is_selected_in_a_field_is_seen(of, ground):
    selected = of.variables["input-selection-background"]
    assert contrast(selected, value(of, ground)) >= 3
    assert contrast(of.variables["input-selection-foreground"], selected) >= 4.5


@pytest.mark.parametrize("of", TRUE, ids=lambda each: each.name)
def test_a_banner_is_read(of):
    mixed = Color.parse(of.background).blend(Color.parse(value(of, "dead")), 0.25)  # as silo.tcss mixes it
    assert contrast(of.foreground, mixed.hex) >= 4.5


@pytest.mark.parametrize("of", theme.THEMES, ids=lambda each: each.name)
def test_the_roles_are_told_from_each_other_and_from_text(of):
    told = [value(of, role) for role in ("foreground", "success", *theme.ROLES)]
    assert len(set(told)) == len(told)
    if not of.ansi:
        apart = [
            sum(abs(a - b) for a, b in zip(Color.parse(one).rgb, Color.parse(other).rgb, strict=True))
            for place, one in enumerate(told)
            for other in told[place + 1 :]
        ]
        assert min(apart) >= 45


@pytest.mark.parametrize("of", TRUE, ids=lambda each: each.name)
def test_curves_are_told_from_their_ground_and_from_each_other(of):
    colors = [_style(place, few=False, dark=of.dark).color.get_truecolor().hex for place in range(len(_IN_16))]
    assert min(contrast(color, value(of, ground)) for color in colors for ground in ("background", "panel")) >= 3
    assert len(set(colors)) == len(set(_IN_16)) == 8


@pytest.mark.parametrize(
    ("name", "style"),
    [("warning", "bold red"), ("own", "bold none"), ("hex", "bold #123456"), ("gone", "bold none"), ("", "")],
)
def test_a_word_that_is_to_be_seen_is_bold_in_its_colour_and_plain_without_a_name(name, style):
    assert theme.bold({"warning": "ansi_red", "own": "ansi_default", "hex": "#123456"}, name) == style


def test_colours_are_named_in_one_place_only():
    folder = Path(theme.__file__).parent
    sheets = [*folder.rglob("*.tcss"), *(set(folder.rglob("*.py")) - {folder / "theme.py"})]
    literal = re.compile(r"#[0-9a-f]{6}\b|bold (?:red|yellow|green|cyan|magenta)|\$(?:error|secondary|accent)\b")
    assert [
        (path.name, found) for path in sheets if path.stem != "styled" and (found := literal.findall(path.read_text()))
    ] == []


def test_the_sixteen_are_the_terminals_own_without_those_that_are_not_seen():
    used = {value for value in vars(theme.SIXTEEN).values() if isinstance(value, str)}
    used |= set(theme.SIXTEEN.variables.values()) | set(theme.FALLBACK.values())
    colors = {each for each in used if each.startswith(("ansi", "#"))}
    assert all(each.startswith("ansi_") for each in colors)
    assert not colors & {"ansi_blue", "ansi_bright_black"}


def test_every_theme_of_the_settings_is_there():
    assert [theme.theme_name(word) for word in OPTION["theme"].words] == [each.name for each in theme.THEMES]


@pytest.mark.parametrize("word", OPTION["theme"].words)
async def test_the_table_is_drawn_in_every_theme(fake, opened, word):
    async with opened(fake.run(), settings=Settings(theme=word)) as screen:
        await screen.do("j", "space", "edit_divider", "5", "enter", "V", "j")
        assert screen.app.theme == f"silo-{word}"
        await screen.shows("pending")
        await screen.press("m", shows="plots 1-5 of 6")


@pytest.mark.parametrize("word", OPTION["theme"].words)
async def test_without_colours_none_are_sent_and_the_cursor_is_reversed(fake, opened, monkeypatch, word):
    monkeypatch.setenv("NO_COLOR", "1")
    async with opened(fake.run(), settings=Settings(theme=word)) as screen:
        await screen.do("j", "space", "edit_divider", "5", "enter", shows="pending")
        lines = [screen.app.screen.get_style_at(3, y) for y in range(3, 7)]
        painted = [segment.style for line in filtered(screen) for segment in line if segment.style]
        assert painted
        colors = [color for style in painted for color in (style.color, style.bgcolor) if color is not None]
        assert all(color.is_default for color in colors)
        assert [bool(style.reverse) for style in lines].count(True) == 1


def filtered(screen):
    """The lines of the screen as they are sent."""
    app = screen.app
    background = app.screen.background_colors[1]
    return [line.apply_filter(app._filters[-1], background) for line in screen._lines()]


async def test_sixteen_colours_send_nothing_but_these(fake, opened):
    async with opened(fake.run(), settings=Settings(theme="16")) as screen:
        await screen.do("j", "space", "edit_divider", "5", "enter", "question_mark")
        await screen.pilot.pause()
        styles = [segment.style for line in screen._lines() for segment in line if segment.style]
        codes = " ".join(style.render("x") for style in styles)
        assert styles
        assert not re.search(r"[34]8;[25];", codes)
        assert not re.search(r"(?:^|[;\[])(?:34|90|44|100)(?=[;m])", codes)


@pytest.mark.slow
@pytest.mark.parametrize("word", ("dark", "light", "contrast", "16"))
async def test_the_line_under_the_cursor_is_of_one_colour(fake, opened, word):
    async with opened(fake.run(), settings=Settings(theme=word)) as screen:
        await screen.press("j")
        await screen.until(lambda: "…" not in screen.text.splitlines()[3][-8:], "values")
        table = screen.app.screen.table
        line = list(table.render_line(table.rows.position))[:-1]  # without the rail
        found = [segment for segment in line if segment.text.isspace()]
        grounds = {segment.style.color if segment.style.reverse else segment.style.bgcolor for segment in found}
        assert len(found) > 3
        assert len(grounds) == 1, found


async def test_the_colon_line_takes_the_words_of_the_command_line(screen):
    for word, name in (("light", "silo-light"), ("16", "silo-16"), ("nord", "nord")):
        CommandRunner(screen.app.context).run(f"theme {word}")
        assert screen.app.theme == name
    CommandRunner(screen.app.context).run("theme drak")
    await screen.shows("themes: dark, light, contrast, 16")
