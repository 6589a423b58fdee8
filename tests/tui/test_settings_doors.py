"""Every spelling of a setting through every door: the same options come of it, or the same words."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import silo
from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import Action, BufferType, Edit, ElementOptions
from silo.errors import ElementError, RefusedError, ScriptError
from silo.settings.typed import find_option
from silo_tui.commands.runner import CommandRunner
from silo_tui.model.table.fields import Field, options_of, rows_of
from silo_tui.widgets.inputs import CellEditor

START = ElementOptions(True, 8, Action.SAVE, BufferType.GROWING, 1000)
NAME = "/log/x"
NUMBER = "must be a whole number from 1 to 2147483647"
DIVIDER = "divider must be 1 to 2147483647, 50Hz, *2, /2 or +1"
SIZE = "size must be 1 to 2147483647, 10k, 10s, *2, /2 or +10"

# typed, the field that becomes another, its value, in a logger of 400 Hz
TAKEN = [
    ("divider=5", "divider", 5), ("div=5", "divider", 5), ("div=2.0", "divider", 2), ("divider=50Hz", "divider", 8),
    ("div=80hz", "divider", 5), ("div=*2", "divider", 16), ("div=/3", "divider", 3), ("div=+1", "divider", 9),
    ("div=-1", "divider", 7), ("size=1000", "size", 1000), ("buffer_size=9", "size", 9),
    ("size=10k", "size", 10_000), ("size=1.5M", "size", 1_500_000), ("size=*2", "size", 2000),
    ("size=/3", "size", 334), ("size=10s", "size", 500), ("size=500ms", "size", 25),
    ("size=2min", "size", 6000), ("size=1h", "size", 180_000), ("size=1e3", "size", 1000),
    ("buffer=fix", "buffer", 0), ("buf=fixed", "buffer", 0), ("buffer=FIXED_SIZE", "buffer", 0),
    ("buffer=looping", "buffer", 1), ("buffer_type=loop", "buffer", 1), ("buffer=1", "buffer", 1),
    ("buf=grow", "buffer", 2), ("buffer=exponentially-growing", "buffer", 2),
    ("action=both", "action", 0), ("act=0", "action", 0), ("action=save_and_publish", "action", 0),
    ("action=save+publish", "action", 0), ("act=pub", "action", 2), ("action=Publish", "action", 2),
    ("enabled=off", "enabled", 0), ("log=off", "enabled", 0), ("on=no", "enabled", 0), ("logging=0", "enabled", 0),
    ("enabled=on", "enabled", 1), ("on=x", "enabled", 1), ("enabled=True", "enabled", 1),
]  # fmt: skip

# typed, the field, and what is said of it
REFUSED = [
    ("divider=0", "divider", f"divider {NUMBER}, got 0"),
    ("div=-8", "divider", f"divider {NUMBER}, got 0 (-8)"),
    ("div=1e12", "divider", f"divider {NUMBER}, got 1000000000000"),
    ("div=1000Hz", "divider", f"divider {NUMBER}, got 0.4 (1000Hz: at most 400 Hz)"),
    ("div=1.5", "divider", f"divider {NUMBER}, got 1.5"),
    ("div=two", "divider", f"{DIVIDER}, got two"),
    ("div=10s", "divider", f"{DIVIDER}, got 10s; a time only sets the size"),
    ("size=1e9s", "size", f"size {NUMBER}, got 50000000000 (1e9s)"),
    ("size=2147483648", "size", f"size {NUMBER}, got 2147483648"),
    ("size=*1e30", "size", f"size {NUMBER}, got 1e+33 (*1e30)"),
    ("size=10x", "size", f"{SIZE}, got 10x"),
    ("size=50Hz", "size", f"{SIZE}, got 50Hz; a rate only sets the divider"),
    ("buffer=round", "buffer", "buffer must be looping (1), fixed (0) or growing (2), got round"),
    ("action=7", "action", "action must be save (1), both (0) or publish (2), got 7"),
    ("enabled=maybe", "enabled", "enabled must be on or off, got maybe"),
]

RELATIVE = ("*", "/", "+", "-")


def wanted(field: str, value: int) -> ElementOptions:
    changed = dict(zip(ElementOptions.__struct_fields__, rows_of([START])[:, 0].tolist(), strict=True))
    changed[field] = value
    return options_of(rows_of([START])[:, 0] * 0 + list(changed.values()))


def halves(word: str) -> tuple[str, str]:
    key, _, value = word.partition("=")
    return key, value


def beside(field: str) -> list[str]:
    """A setting that is right, to stand beside one of `field` that is wrong: it must not be taken either."""
    return ["buffer=fix"] if field == "enabled" else ["log=off"]


def in_script(field: str, value: str) -> str:
    inside = {"buffer": f"buffer: {{type: {value}}}", "size": f"buffer: {{size: {value}}}"}
    enabled = "" if field == "enabled" else "enabled: true\n    "
    return f"log_elements:\n  - name: {NAME}\n    {enabled}{inside.get(field) or f'{field}: {value}'}\n"


@pytest.fixture
def log(tmp_path: Path) -> Iterator[silo.Logger]:
    """A logger whose one element is as `START` says."""
    with silo.Logger("doors", frequency=400, max_time=1, folder=tmp_path, script=tmp_path / "doors.yaml") as made:
        made.array("x", divider=8, action="save", buffer="growing", size=1000)
        made.update()
        assert made.elements[0].options == START
        yield made


@pytest.mark.parametrize(("word", "field", "value"), TAKEN)
def test_a_program_takes_every_spelling(log: silo.Logger, word: str, field: str, value: int) -> None:
    key, typed = halves(word)
    log.set("x", **{key: typed})
    assert log.elements[0].options == wanted(field, value)


@pytest.mark.parametrize(("word", "field", "reason"), REFUSED)
def test_a_program_hears_the_reason(log: silo.Logger, word: str, field: str, reason: str) -> None:
    key, typed = halves(word)
    with pytest.raises(ElementError) as error:
        log.set("x", **dict(map(halves, beside(field))), **{key: typed})
    assert str(error.value) == f"element '{NAME}': {reason}; nothing was changed"
    assert log.elements[0].options == START


@pytest.mark.parametrize(
    ("word", "field", "value"), [row for row in TAKEN if not halves(row[0])[1].startswith(RELATIVE)]
)
def test_registering_takes_every_spelling(log: silo.Logger, word: str, field: str, value: int) -> None:
    start = {"divider": 8, "action": Action.SAVE, "buffer": BufferType.GROWING, "size": 1000}
    log.array("other", **{**start, field: halves(word)[1]})
    log.update()
    assert log.elements[1].options == wanted(field, value)


@pytest.mark.parametrize(
    ("word", "field", "value"), [row for row in TAKEN if not halves(row[0])[1].startswith(RELATIVE)]
)
def test_a_script_takes_every_spelling(log: silo.Logger, tmp_path: Path, word: str, field: str, value: int) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(in_script(field, halves(word)[1]))
    log.load_script(path)
    assert log.elements[0].options == wanted(field, value)


@pytest.mark.parametrize(
    ("word", "field", "reason"), [row for row in REFUSED if not halves(row[0])[1].startswith(RELATIVE)]
)
def test_a_script_tells_the_reason_with_its_line(
    log: silo.Logger, tmp_path: Path, word: str, field: str, reason: str
) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(in_script(field, halves(word)[1]))
    with pytest.raises(ScriptError) as error:
        log.load_script(path)
    said = reason.replace(DIVIDER, "divider must be 1 to 2147483647 or 50Hz")  # a script gives no changes
    said = said.replace(SIZE, "size must be 1 to 2147483647, 10k or 10s")
    head, _, text = str(error.value).partition(": ")
    assert head.startswith(f"{path}:")
    assert text == f"element '{NAME}': {said}; nothing was changed"
    assert log.elements[0].options == START


@pytest.mark.parametrize("value", ["/2", "+1.5", "-2k"])
def test_a_script_that_changes_the_value_before_is_refused(log: silo.Logger, tmp_path: Path, value: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(in_script("size", value))
    with pytest.raises(ScriptError, match="a change of the value before has no place here; nothing was changed"):
        log.load_script(path)


@pytest.mark.slow
def test_the_shell_and_the_wire_speak_as_the_program_does(
    log: silo.Logger, runtime_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with log.serve(), Client.connect("doors") as client:
        for word, field, value in TAKEN:
            client.apply([Edit(NAME, START)], -1)
            assert run(["set", "doors", NAME, word]) == 0, word
            assert log.elements[0].options == wanted(field, value), word
        client.apply([Edit(NAME, START)], -1)
        for word, field, reason in REFUSED:
            capsys.readouterr()
            assert run(["set", "doors", NAME, *beside(field), word]) == EXIT_FAILED, word
            assert (
                capsys.readouterr().err.replace(f"element '{NAME}': ", "") == f"silo: {reason}; nothing was changed\n"
            )
            assert log.elements[0].options == START, word
        with pytest.raises(RefusedError) as error:
            client.apply([Edit(NAME, ElementOptions(divider=0))], -1)
        assert str(error.value) == f"element '{NAME}': divider {NUMBER}, got 0; nothing was changed"
        with pytest.raises(RefusedError) as error:
            client.apply([Edit(NAME, ElementOptions(action=7))], -1)  # type: ignore[arg-type]
        assert "action must be save (1), both (0) or publish (2), got 7" in str(error.value)


async def test_the_command_line_of_the_screen_speaks_as_the_program_does(fake, opened) -> None:
    async with opened(fake) as screen:
        table, app = screen.session.table, screen.app
        runner = CommandRunner(app.context)
        row = int(screen.session.rows.targets()[0])
        name = table.names[row]
        for word, field, value in TAKEN:
            table.edit_all([row], rows_of([START]))
            runner.run(f":set {word}")
            assert options_of(table.values[:, row]) == wanted(field, value), word
        table.edit_all([row], rows_of([START]))
        for word, field, reason in REFUSED:
            app.screen.say("")
            runner.run(" ".join([":set", *beside(field), word]))
            said = app.screen.info.said
            assert said.replace(table.shown(f"element '{name}': "), "") == f"{reason}; nothing was changed"
            assert options_of(table.values[:, row]) == START, word


@pytest.mark.slow
async def test_the_editor_of_the_screen_speaks_as_the_program_does(fake, opened) -> None:
    async with opened(fake, size=(200, 30)) as screen:
        table, view = screen.session.table, screen.app.context.upper_screen
        row = int(screen.session.rows.targets()[0])
        for word, field, value in TAKEN:
            table.edit_all([row], rows_of([START]))
            view.table.field = Field[find_option(field).name.upper()]
            await screen.do("edit_all")
            screen.app.screen.query_one(CellEditor).value = halves(word)[1]
            await screen.press("enter")
            assert options_of(table.values[:, row]) == wanted(field, value), word
        table.edit_all([row], rows_of([START]))
        for word, field, reason in REFUSED:
            view.table.field = Field[find_option(field).name.upper()]
            await screen.do("edit_all")
            screen.app.screen.query_one(CellEditor).value = halves(word)[1]
            await screen.press("enter", shows=reason[:100])
            await screen.press("escape")
            assert options_of(table.values[:, row]) == START, word


async def test_settings_that_go_together_are_one_undo_step(fake, opened) -> None:
    async with opened(fake) as screen:
        table = screen.session.table
        CommandRunner(screen.app.context).run(":set div=5 size=10s buf=fix")
        assert table.pending_count == (3, 1)
        table.undo()
        assert table.pending_count == (0, 0)


def test_a_default_size_that_no_buffer_can_have_is_an_error_that_names_max_time(tmp_path: Path) -> None:
    with silo.Logger("long", frequency=1000, max_time=1e8, script=tmp_path / "none") as log:
        with pytest.raises(ElementError) as error:
            log.array("x")
        assert str(error.value) == (
            f"element '/log/x': size {NUMBER}, got 100000000000 (that is max_time, 1e+08 s at 1000 Hz: "
            "give a size); nothing was changed"
        )
        log.array("y", size=10)
        log.update()
        assert [info.name for info in log.elements] == ["/log/y"]
