"""Choosing a logger, scripts, saving data, the command line, help, and the palette."""

import asyncio
import importlib
import os
import pkgutil

import numpy as np
import pytest
from msgspec import structs
from textual.geometry import Size
from textual.widgets import Input

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import Conditions, SignalLimits, TriggerOptions, TriggerWord
from silo.core.elements import BufferType, Entry, FileType
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import ConnectionLostError, RefusedError
from silo.files import write
from silo.fleet.member import Member
from silo.rpc.published import EventKind
from silo_tui import screens as every_screen
from silo_tui.actions import BY_ID, BY_WORD, COMMANDS, footer_for
from silo_tui.commands import flows
from silo_tui.commands.palette import CommandProvider
from silo_tui.keymap import in_menu
from silo_tui.modal import Choices
from silo_tui.model.table.fields import Field
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.lists.help import entries
from silo_tui.screens.table import TableScreen
from silo_tui.sessions import kept

pytestmark = pytest.mark.slow  # each walks through the whole app

FIRST = "/log/base/orientation"
EATEN = {"ctrl+h", "ctrl+i", "ctrl+j", "ctrl+m", "ctrl+enter"}


async def test_without_a_logger_it_is_said_what_to_start_and_whom_to_ask_and_the_first_is_opened(
    fake, opened, tmp_path
):
    (tmp_path / "silo-logs").mkdir()
    for number in range(6, 10):
        (tmp_path / "silo-logs" / f"robot_20260921_14-00-0{number}_0000{number}.silo").touch()
    newest = "Saved in ./silo-logs: robot_20260921_14-00-09_00009.silo"
    async with opened(ready=False) as screen:
        for words in ("silo demo", "log.serve()", "No logger is running", newest, "_00008.silo and 2 more; F3 lists"):
            await screen.shows(words)
        screen.app._finder.advice = ("root has a logger here: ask for group access (serve(group=...))",)
        await screen.shows("ask for group access")
        screen.app._finder.clients.append(fake)
        await screen.shows("/base/position")


@pytest.mark.parametrize("line", ["/", ":"])
async def test_a_logger_that_comes_while_a_line_is_typed_opens_once_that_is_left(line, fake, opened):
    async with opened(ready=False) as screen:
        await screen.shows("No logger is running")
        await screen.press(line)
        await screen.until(lambda: isinstance(screen.app.focused, Input), "the line")
        looked, find = [], screen.app._finder.find
        screen.app._finder.find = lambda: looked.append(1) or find()
        screen.app._finder.clients.append(fake)
        await screen.until(lambda: len(looked) > 2, "the logger found twice")
        await screen.press("o", "n")
        assert screen.app.focused.value == "on"  # on the table they ordered it
        await screen.press("escape", shows="/base/position")
        assert screen.session.rows.sort == "name"


async def test_of_several_loggers_one_is_chosen(new_fake, opened):
    one, two = new_fake(name="arm"), new_fake(name="legs")
    async with opened(one, two, ready=False) as screen:
        await screen.shows("legs")
        await screen.press("down", "enter")
        await screen.until(lambda: screen.app.context.has_session and len(screen.session.table))
        assert screen.session.name == "legs"


async def test_a_name_that_nobody_has_is_told_beside_those_that_run(screen, name="arm", ready=False):
    await screen.shows("There is no logger called 'arm'")
    await screen.shows("pid 4711")


async def test_edits_are_kept_when_the_robot_program_was_started_again(fake, screen):
    await screen.press("d", "5", "enter")
    fake.cut()
    await screen.shows("No link")
    fake.pid, fake.revision = 5000, 1
    fake.mend()
    await screen.shows("started again")
    assert screen.value(FIRST, Field.DIVIDER) == "5"
    assert ":restore" not in screen.text


@pytest.mark.parametrize(
    ("how", "pid", "program"),  # pids count anew in each container
    [("at once", 5000, ""), ("at once", 4711, "b2"), ("in part first", 4711, "b2"),
     ("to a question from before", 4711, "b2"), ("before it is told", 4711, "b2")],
)  # fmt: skip
async def test_conditions_that_a_new_program_knows_nothing_of_are_named(how, pid, program, fake, opened, monkeypatch):
    fake.program = "a1" if program else ""  # of an older silo
    fake.trigger_statuses = [
        TriggerStatus(TriggerOptions(name, "legs/LF/HAA/torque > 3", 5.0, 1.0), TriggerWord.ARMED)
        for name in ("fall", "slip")
    ]
    async with opened(fake.run()) as screen:
        await screen.until(lambda: len(screen.session.triggers) == 2, "what is judged")
        fake.cut()
        await screen.shows("No link")
        fake.pid, fake.program, fake.trigger_statuses = pid, program, fake.trigger_statuses[:1]
        if how == "in part first":
            table = fake.table

            def not_yet(told):
                monkeypatch.setattr(fake, "table", table)
                raise ConnectionLostError("no answer")

            monkeypatch.setattr(fake, "table", not_yet)
        elif how == "to a question from before":
            screen.session.triggers = fake.trigger_statuses
            screen.session.take_status(structs.replace(screen.session.status, pid=pid, program=program))
        elif how == "before it is told":
            fake.connected = True
            screen.app._second()
            await screen.until(lambda: screen.session.connected, "the link")
        fake.mend()
        await screen.shows("started again; :restore brings back what is gone: trigger slip")
        await screen.settled()
        assert "what is gone: trigger slip" in screen.text
        assert "fall" not in screen.text
        await screen.enter(":restore", shows="set again: trigger slip")
        assert [one.options.name for one in fake.trigger_statuses] == ["fall", "slip"]
        await screen.enter(":restore", shows="nothing is gone")


@pytest.mark.parametrize(("pid", "program"), [(5000, ""), (4711, "b2")])
async def test_conditions_that_went_with_the_program_are_named_at_the_next_start_too(pid, program, fake, opened):
    fake.program = "a1" if program else ""
    made = [TriggerOptions(name, "legs/LF/HAA/torque > 3", 5.0, 1.0) for name in ("fall", "slip")]
    fake.trigger_statuses = [TriggerStatus(one, TriggerWord.ARMED) for one in made]
    async with opened(fake.run()) as screen:
        await screen.until(lambda: kept.conditions_of("anymal", "robot"), "what is kept")
    fake.pid, fake.program, fake.trigger_statuses, fake.connected = pid, program, fake.trigger_statuses[:1], True
    async with opened(fake) as screen:
        await screen.shows(":restore brings back what is gone: ")
    fake.connected = True
    async with opened(fake) as screen:  # told once, and there to be looked up
        await screen.until(lambda: screen.session.lent.gone, "what is kept")
        assert ":restore" not in screen.text
        await screen.do("triggers", shows="Gone with the program before: trigger slip; :restore")
        await screen.enter(":restore", shows="set again: trigger slip")
        await screen.until(lambda: "Gone with" not in screen.text, "the triggers")


@pytest.mark.parametrize("how", ["while one looks", "at the next start"])
async def test_edits_that_went_with_the_program_are_told_and_restored_as_edits_to_apply(how, fake, opened):
    begun = list(fake.elements)
    fake.elements = [structs.replace(begun[0], options=structs.replace(begun[0].options, divider=5)), *begun[1:]]
    fake.given, fake.program = {begun[0].name: begun[0].options}, "a1"
    told = "(divider)"

    def start_again():
        fake.program, fake.pid, fake.elements, fake.given = "b2", 5000, begun, {}
        fake.revision += 1

    async with opened(fake.run()) as screen:
        await screen.until(lambda: (found := kept.conditions_of("anymal", "robot")) and found.edits, "what is kept")
        if how == "while one looks":
            fake.cut()
            await screen.shows("No link")
            start_again()
            fake.mend()
            await screen.shows(told)
            await restored(screen)
    if how == "at the next start":
        start_again()
        fake.connected = True
        async with opened(fake) as screen:
            await screen.shows(told)
            await restored(screen)


async def restored(screen):
    await screen.enter(":restore", shows="1 edit pending again: a applies")
    assert [edit.options.divider for edit in screen.session.table.edits()] == [5]
    await screen.enter(":restore", shows="nothing is gone")


@pytest.mark.parametrize("how", ["while one looks", "at the next start"])
async def test_what_a_program_gives_itself_before_it_starts_is_not_told_to_be_gone(how, fake, opened):
    slip = [TriggerStatus(TriggerOptions("slip", "legs/LF/HAA/torque > 3", 5.0, 1.0), TriggerWord.ARMED)]
    fake.trigger_statuses, fake.program = slip, "a1"

    def start_again():
        fake.program, fake.pid, fake.trigger_statuses = "b2", 5000, []

    async def given(screen):
        await screen.until(lambda: screen.session.lent.gone, "what is gone so far")
        fake.trigger_statuses = slip
        fake.run().publish(EventKind.STARTED, "started", by="the program")
        await screen.until(lambda: not screen.session.lent.gone, "the program gave it")
        assert ":restore" not in screen.text

    async with opened(fake) as screen:
        await screen.until(lambda: (found := kept.conditions_of("anymal", "robot")) and found.there.triggers, "kept")
        if how == "while one looks":
            fake.cut()
            await screen.shows("No link")
            start_again()
            fake.mend()
            await given(screen)
    if how == "at the next start":
        start_again()
        fake.connected = True
        async with opened(fake) as screen:
            await given(screen)


def test_what_an_older_terminal_kept_of_conditions_is_of_a_program_that_is_gone():
    there = Conditions(triggers=(TriggerOptions("slip", "x > 3", 5.0, 1.0),))
    kept.keep_conditions("anymal", "robot", kept.KeptConditions(there))
    path = kept._path_of_conditions("anymal", "robot")
    path.write_bytes(path.read_bytes().replace(b'"program":""', b'"pid":4711'))
    assert kept.conditions_of("anymal", "robot") == kept.KeptConditions(there)


async def test_what_can_not_be_set_again_is_told_and_stays_to_be_tried(fake, opened, monkeypatch):
    quiet = LimitStatus("/log/y", "/log/y", LimitWord.OK, value=1.0, bounds=(None, 0.0, 2.5, None), persistence=3)
    fake.limit_statuses = [quiet]
    async with opened(fake.run()) as screen:
        await screen.until(lambda: screen.session.limits, "what is judged")
        fake.cut()
        await screen.shows("No link")
        fake.pid, fake.limit_statuses = 5000, []
        fake.mend()
        await screen.shows("what is gone: limits of /y")
        with monkeypatch.context() as refusing:
            refusing.setattr(fake, "_set_limits", refused_with("there is no y"))
            await screen.enter(":restore", shows="refused: limits of /y: there is no y")
        await screen.enter(":restore", shows="set again: limits of /y")
        assert fake.calls[-1] == ("set_limits", SignalLimits("/log/y", bounds=(None, 0.0, 2.5, None), persistence=3))


def refused_with(words):
    def refuse(*_):
        raise RefusedError(words)

    return refuse


async def test_applying_tells_that_a_single_trigger_that_fired_watches_again(fake, opened):
    options = TriggerOptions("fall", "legs/LF/HAA/torque > 3", 5.0, 1.0, mode="single")
    fake.trigger_statuses = [TriggerStatus(options, TriggerWord.FIRED)]
    async with opened(fake.run()) as screen:
        await screen.until(lambda: screen.session.triggers, "what is judged")
        await screen.press("d", "5", "enter", "a", shows="Apply and go on")
        await screen.shows("'fall', fired")
        await screen.press("escape")


async def test_data_is_saved_in_the_types_that_are_chosen_and_that_takes_the_place_of_what_was_to_be_done_before(
    fake, screen, ran_s=12, size=(100, 30)
):
    await screen.press("w")
    await screen.shows("Save data")
    await screen.shows("what was logged; W saves the script instead, elsewhere ")
    await screen.press("W")
    await screen.shows("Save the script")
    await screen.press("escape", "w", "down", "space")
    await screen.shows("space s c b Tick  W Script")
    focused = screen.app.screen.focused
    screen.app.screen.field("name").focus()  # where letters are of it
    await screen.until(lambda: "Tick  W" not in screen.text, "the keys that count there")
    await screen.shows("Enter Saves")
    focused.focus()
    await screen.shows("space s c b Tick  W Script")
    await screen.press("enter")
    await screen.until(lambda: fake.calls)
    assert fake.calls == [("save", [FileType.SILO, FileType.CSV], "")]
    await screen.shows("/home/ann/logs/robot_00001.silo")
    await screen.shows("1.23 MB")
    await screen.shows("o Opens it")
    await screen.press("escape", "S", "y")
    await screen.shows("stopped; w saves the data")
    await screen.press("w", "enter")
    await screen.shows("Close")
    await screen.press("enter")
    await screen.shows("saved: ")
    assert "w saves the data" not in screen.text


async def test_o_opens_what_was_saved_once_it_is_and_nothing_before(fake, opened, monkeypatch):
    looked_into = []

    async def opening(context, session, files, *_):
        looked_into.append([file.path for file in files])

    monkeypatch.setattr("silo_tui.screens.files.opened.open_saved", opening)
    async with opened(fake.run(12)) as screen:
        await screen.press("w", "o", shows="what was logged")
        await screen.press("enter", shows="saved: ")
        assert looked_into == []
        await screen.press("o")
        await screen.until(lambda: looked_into)
        assert [len(files) for files in looked_into] == [1]
        assert looked_into[0][0].endswith(".silo")


async def test_a_save_says_that_it_is_of_all_elements_though_some_are_marked_and_what_a_part_is(screen, ran_s=12):
    await screen.do("mark", "mark", "save_data")
    await screen.shows("all elements, not the 2 marked alone; W saves the script instead")
    await screen.do("down", "down", "down")
    await screen.type("walk_part4")
    await screen.press("enter")
    await screen.shows("walk_part4.silo")
    await screen.shows("a part of a run: applying edits while it logs begins a new file;")
    await screen.shows("any one of them opens all")


def after(job, done):
    """Returns a job that tells when it was done."""

    async def run():
        await job()
        done.set()

    return run


async def test_a_failed_save_says_why_until_something_else_is_to_be_saved(fake, opened, monkeypatch):
    fake.run()
    fake.save_error = "no space left on /home/ann/logs: 3 MB free, 40 MB needed"
    async with opened(fake, size=(100, 30)) as screen:
        await screen.press("w", "enter", shows="no space left")
        told = screen.app.screen.query_one("#form-told")
        looked = asyncio.Event()
        monkeypatch.setattr(screen.app.screen, "_look_now", after(screen.app.screen._look_now, looked))
        screen.app.screen.look_soon()
        await looked.wait()
        assert "no space left" in screen.text and told.has_class("failed")
        await screen.press("down", "space", shows=".csv: ")  # something else is to be saved
        assert not told.has_class("failed")


@pytest.mark.parametrize(
    ("typed", "types", "name", "error", "told"),
    [
        ("csv abc", [FileType.CSV], "abc", "", "saved: /home/ann/logs/abc.csv (1.23 MB)"),
        ("silo bag walk3", [FileType.SILO, FileType.BAG], "walk3", "no space left", "not saved: no space left"),
    ],
)
async def test_data_is_saved_by_a_name_that_is_typed_and_its_end_told_whose_dialog_was_left(
    fake, opened, typed, types, name, error, told
):
    fake.run()
    fake.save_takes_long, fake.save_error = True, error
    async with opened(fake, size=(100, 30)) as screen:
        await screen.enter(f":data {typed}")
        await screen.until(lambda: fake.calls)
        assert fake.calls == [("save", types, name)]
        await screen.press("escape", shows="its end will be told")
        fake.end_save(types, name)
        await screen.shows(told)


async def test_a_script_is_previewed_before_it_is_loaded_and_what_nobody_knows_of_it_told_both_times(fake, opened):
    fake.files["quiet.yaml"] += "colour: red\n"
    async with opened(fake, size=(100, 30)) as screen:
        await screen.press("L", shows="quiet.yaml")
        await screen.press("k", shows="40 → 4")
        await screen.shows(": /old/thing")
        await screen.shows("'colour'")
        await screen.press("enter")
        await screen.until(lambda: ("load_script", "quiet.yaml") in fake.calls)
        await screen.shows("loaded quiet.yaml")
        await screen.shows("unknown key 'colour' in a script")
        assert not screen.session.table.pending.any()
        await screen.do("undo")
        await screen.shows("undone: what was applied to")
        assert screen.session.table.pending.any(), "what the logger had before is wanted back"


async def test_a_script_is_there_as_it_is_saved_and_another_overwritten_only_when_asked(fake, screen, size=(100, 30)):
    await screen.enter(":load abc")
    await screen.shows("there is no script")
    await screen.press("W")
    await screen.shows("Save the script")
    for _ in range(12):
        await screen.press("backspace")
    await screen.enter("abc")
    await screen.until(lambda: "abc.yaml" in fake.files, "the script")
    await screen.shows("abc.yaml: scripts end in .yaml")
    await screen.enter(":load abc")
    await screen.shows("abc.yaml says what the logger has already")
    await screen.enter(":save robot.yaml")
    await screen.shows("Overwrite robot.yaml?")
    await screen.press("y")
    await screen.until(lambda: ("save_script", "robot.yaml", True) in fake.calls)


async def test_the_set_command_edits_what_is_marked_and_an_unknown_one_offers_what_is_near(screen):
    await screen.press("space", "space")
    await screen.enter(":set div=4 size=10s buf=grow")
    assert [screen.value(FIRST, field) for field in (Field.DIVIDER, Field.SIZE)] == ["4", "1000"]
    assert screen.session.table.pending_count[1] == 2
    await screen.enter(":set LF/HAA/torque */KFE/torque size=14", shows="5 fields changed")
    assert screen.value("/log/legs/LF/HAA/torque", Field.SIZE) == "14"
    await screen.enter(":set imu/tmperature size=14")
    await screen.shows("no element is called 'imu/tmperature'; did you mean")
    await screen.enter(":lod", shows="did you")


async def test_the_palette_finds_by_words_of_a_sentence_and_not_by_letters_that_are_in_any(screen, size=(100, 40)):
    for typed, *shown in (
        ("take the last", "Undo"),
        (":view", ":view [save] NAME", "put a view on the screen, or keep it"),  # brackets as they are typed
        ("beyond its", "Alarms  (A)"),
        ("in a browser", "silo-tui --serve"),
        ("so many are logged", "elements on"),  # what only the help has a line for
    ):
        await screen.press("ctrl+p")
        await screen.type(typed)
        for words in shown:
            await screen.shows(words)
        options = screen.app.screen.query_one("CommandList").option_count
        await screen.type(" shores")
        await screen.shows("No matches found")
        await screen.press("escape", "escape")
    assert options == 1


async def test_the_palette_finds_what_the_help_has_a_line_for_and_tells_what_is_no_command(screen, size=(120, 40)):
    palette = CommandProvider(screen.app.screen)
    for line in entries("table", everywhere=True):
        hidden = line.command in ("back", "excite") or bool(line.command and BY_ID[line.command].hidden)
        if hidden or line.group == "Move":  # what moves; Excite is found by what is typed
            continue
        assert [hit async for hit in palette.search(line.right)], line
    for word, first in (("script", 4), ("configuration", 1), ("scr", 4)):  # none that has it within another word
        hits = sorted([hit async for hit in palette.search(word)], key=lambda hit: -hit.score)
        told = [f"{hit.prompt} {hit.help}" for hit in hits]
        assert all(f" {word}" in each for each in told[:first]), told
        assert [each for each in told if each.startswith("Save script")], told
    await screen.press("ctrl+p")
    await screen.type("so many are logged, of", shows="elements on")
    await screen.press("enter", "enter", shows="elements on: so many are logged, of all")


@pytest.mark.parametrize("word", ["browser", "serve", "web"])
async def test_how_all_is_shown_in_a_browser_is_told_by_its_word_and_by_the_menu(fake, opened, word):
    async with opened(fake, size=(120, 40)) as screen:
        await screen.enter(f":{word}")
        await screen.shows("`silo-tui --serve`, typed in a shell, shows all of it as a web page, in a browser")
    assert [each.id for each in in_menu("menu_go", "monitor")["b"]] == ["browser"]


async def test_the_palette_finds_a_spectrum_from_the_table_and_from_the_plots_and_leads_there(screen, size=(120, 40)):
    await screen.press("ctrl+p")
    await screen.type("spectrum", shows="(large plot, Tab v)")
    await screen.press("enter", shows="Enter makes it so")
    await screen.press("ctrl+p")
    await screen.type("spectrum", shows="(large plot, Tab v)")
    await screen.press("enter", shows="once one plot is large")
    await screen.press("ctrl+p")
    await screen.type("spectrum", shows="over time, x-y, spectrum, histogram")
    assert "large plot," not in screen.text


async def test_the_palette_finds_what_another_screen_has_and_what_can_only_be_typed_and_leads_there(
    screen, size=(100, 40)
):
    await screen.press("ctrl+p")
    await screen.type("over the live plots", shows="Overlay")
    await screen.press("enter", "enter", shows="Overlay (O): it is a key of recordings (F)")
    await screen.press("escape", "ctrl+p")
    await screen.type("put the cursor there", shows=":goto NAME")
    await screen.press("enter", shows="Tab completes")
    await screen.until(lambda: any(line.startswith(" :goto") for line in screen.text.splitlines()), "the colon")
    await screen.shows(f":goto NAME: {BY_WORD['goto'].typed.help}")
    await screen.enter("imu/temp")
    await screen.until(lambda: screen.session.table.names[screen.session.rows.row] == "/log/imu/temperature")


async def test_ctrl_u_in_a_command_line_takes_away_what_stands_behind_the_word_then_the_word(screen):
    await screen.press("colon", *"mark", "space", *"imu", "space", *"base")
    line = screen.app.screen.query_one("#command-over")
    for left in ("mark ", "", ""):
        await screen.press("ctrl+u")
        assert line.value == left
    await screen.press(*"plot", "space", *"imu", "left", "ctrl+u")
    assert line.value == "plot u"  # what is behind the cursor stays


async def test_a_dialog_leaves_the_table_to_be_seen_news_of_others_are_told_and_what_is_edited_has_its_column(
    fake, screen, size=(120, 40)
):
    fake.publish(fake.kinds.EDITED, "3 elements edited", by="ann@here silo-tui 1")
    fake.publish(fake.kinds.SCRIPT_SAVED, "script saved", by="bob@lab silo-tui 9")
    await screen.shows("script saved (bob@lab silo-tui 9)")
    await screen.press("e")
    await screen.shows("Edit what of /base/orientation?")
    lines = screen.text.splitlines()
    assert "/base/orientation" in lines[2]
    title = next(line for line in lines if "Edit what of" in line)
    assert title.index("Edit what of") > 20
    await screen.press("escape")
    await screen.do("columns")
    await screen.until(lambda: Field.DIVIDER not in screen.app.screen.table.field_spans())
    await screen.press("d")
    await screen.until(lambda: Field.DIVIDER in screen.app.screen.table.field_spans(), "what is edited")
    await screen.press("5", "enter")
    await screen.until(lambda: screen.value(FIRST, Field.DIVIDER) == "5")


@pytest.fixture
def saved_log(tmp_path):
    """A log of this machine."""
    time_ns = 1_790_000_000 * 10**9 + np.arange(101, dtype=np.int64) * 10**7
    entry = RecordedEntry("/log/x", Entry("", "<f8"), np.sin(np.arange(101) / 20))
    signal = RecordedElement("/log/x", "Nm", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))
    (file,) = write(Recording("bot", time_ns, 101, [signal]), tmp_path, "bot", ["silo"], "walk")
    return file.path


async def test_a_file_of_this_machine_is_opened_over_the_logger_by_a_word_of_the_palette_and_one_that_is_no_log_is_told(
    fake, opened, saved_log, tmp_path
):
    (tmp_path / "none.silo").write_text("not a log")
    async with opened(fake, size=(160, 50)) as screen:
        await screen.enter(f":open {tmp_path}/none.silo", shows="can't be opened")
        assert isinstance(screen.app.screen, TableScreen)
        live = screen.session
        await screen.press("ctrl+p")
        await screen.type("saved log of this machine", shows=":open FILE")
        await screen.press("enter", shows="Tab completes")
        await screen.type(f"{tmp_path}/wa")
        await screen.press("tab", "enter", at="file")
        await screen.until(lambda: "walk.silo" in screen.text.partition("\n")[0], "its name")
        await screen.press("escape", at="table")
        assert screen.session is live


async def test_tab_goes_on_in_the_folder_that_it_took_and_enter_lists_that(fake, opened, saved_log, tmp_path):
    for at, name in enumerate(("b.silo", "c.silo")):
        (tmp_path / name).write_bytes((tmp_path / "walk.silo").read_bytes())
        os.utime(tmp_path / name, (at, at))
    (tmp_path.parent / f"{tmp_path.name}2").mkdir(exist_ok=True)
    async with opened(fake, size=(160, 50)) as screen:
        await screen.press(":")
        await screen.type(f"open {tmp_path}")
        taken = []
        for _ in range(4):
            await screen.press("tab")
            taken.append(screen.app.screen.query_one(Input).value.removeprefix(f"open {tmp_path}"))
        assert taken == ["/", "/walk.silo", "/c.silo", "/b.silo"]
        await screen.press("escape", ":")
        await screen.type(f"open {tmp_path}/")
        await screen.shows(f"Enter lists the logs in {tmp_path}/, Tab takes the one in grey")
        await screen.press("enter", at="runs")
        await screen.shows("walk")


def test_no_key_is_one_that_terminals_eat():
    keys = {key for command in COMMANDS for key in command.keys.split(",")}
    assert not {key for key in keys if key in EATEN or key.startswith("alt+")}


def test_a_read_only_key_bar_shows_nothing_that_writes():
    assert not [command for command in footer_for("table", read_only=True) if command.writes]


def test_every_command_has_its_method():
    from silo_tui.app import SiloApp
    from silo_tui.commands.runner import CommandRunner

    names = [one.name for one in pkgutil.walk_packages(every_screen.__path__, f"{every_screen.__name__}.")]
    found = [one for name in names for one in vars(importlib.import_module(name)).values()]
    classes = {one for one in found if isinstance(one, type) and "scope" in vars(one)}
    screens = {one.scope: one for one in classes if one.scope}
    for command in COMMANDS:
        for scope in command.scopes if "any" not in command.scopes else screens:
            screen = screens.get(scope) or screens[scope.removeprefix("file_")]
            owners = (screen, *screen.PARTS, CommandRunner, SiloApp)
            assert any(hasattr(owner, command.method) for owner in owners), (scope, command.id)


async def test_a_logger_that_doesn_t_answer_is_told_with_what_to_do(fake, opened):
    fake.connected = False
    async with opened(fake, ready=False) as screen:
        await screen.shows("no answer from robot")


async def test_another_logger_is_opened_from_the_plots_or_the_table_after_a_question_where_edits_are_pending(
    new_fake, opened
):
    one, two = new_fake(name="arm"), new_fake(name="legs")
    async with opened(one, two, name="arm") as screen:
        await screen.press("m")
        plots = screen.app.screen
        assert plots.scope == "monitor"
        await screen.press("ctrl+l", shows="legs")
        await screen.press("escape")
        assert screen.app.screen is plots
        await screen.press("escape", "t", "ctrl+l", shows="legs")
        await screen.press("down", "enter", shows="Leave arm?")
        await screen.press("escape", "escape")
        assert (screen.session.name, screen.session.table.pending_count) == ("arm", (1, 1))
        await screen.press("t", "m", "ctrl+l", shows="legs")
        await screen.press("down", "enter")
        await screen.until(lambda: screen.app.context.has_session and screen.session.name == "legs")
        await screen.until(lambda: screen.session.connected)


async def test_a_picture_is_an_svg_also_where_it_is_called_png_and_each_screen_says_where(screen, tmp_path, ran_s=20):
    for name, keys in (("x.svg", ()), ("p2.png", ("m", "enter"))):
        await screen.plot(*keys) if keys else None
        await screen.press(":")
        screen.app.screen.query_one("#command-over").value = f"picture {tmp_path / name}"
        await screen.press("enter")
        path = (tmp_path / name).with_suffix(".svg")
        await screen.until(path.exists, "the picture")
        await screen.shows("picture of the screen")
        assert "<svg" in path.read_text()
    assert screen.app.screen.scope == "detail"
    assert not (tmp_path / "p2.png").exists()


async def test_a_long_difference_leaves_the_choices_on_a_small_screen(fake, opened, monkeypatch):
    monkeypatch.setattr(flows, "_held", lambda context: "1 426 433 samples, 13 min 27 s at most")  # wraps its choice
    async with opened(fake.run()) as screen:
        await screen.press("*", "d", "5", "enter")
        for size in ((80, 24), (160, 24), (160, 50)):
            await screen.pilot.resize_terminal(*size)
            await screen.press("a", shows="Keep them pending")
            await screen.shows("Discard all edits")
            options, body = screen.app.screen.query_one(Choices), screen.app.screen.query_one(".dialog-body")
            await screen.press("pagedown")
            await screen.until(lambda body=body: body.scroll_y > 0 or body.max_scroll_y == 0, f"its end at {size}")
            await screen.press("up", "k")
            assert options.highlighted == 0
            await screen.press("escape")
            await screen.until(lambda: not screen.app.screen.is_modal, f"the table, as it was before, at {size}")


async def test_on_a_small_screen_every_choice_is_there_and_what_was_said_last_is_read_whole(screen, ran_s=12):
    for key, *choices in (
        ("e", "divider", "size", "buffer", "action"), ("N", "A trigger", "Limits", "A signal derived from it"),
    ):  # fmt: skip
        await screen.press(key)
        await screen.until(lambda: screen.app.screen.is_modal)
        await screen.press("pagedown")
        for choice in choices:
            assert choice in screen.text
        await screen.press("escape")
    await screen.press("*", "d", "5", "enter", "d", "0", "enter", shows="2147483647")


async def test_a_question_that_hears_of_its_size_before_its_choices_do_is_drawn_whole(fake, opened, monkeypatch):
    laid_out, resized, sizes = Choices.container_size.fget, Question.on_resize, []

    def early(question, event):
        sizes.append(Size(0, 0))
        resized(question, event)
        sizes.clear()

    monkeypatch.setattr(Question, "on_resize", early)
    monkeypatch.setattr(Choices, "container_size", property(lambda each: sizes[0] if sizes else laid_out(each)))
    async with opened(fake.run(30), size=(80, 24)) as screen:
        await screen.press("N")
        for choice in ("A trigger", "Limits", "A signal derived from it"):
            await screen.shows(choice)
        await screen.press("escape")
        monkeypatch.setattr(Question, "on_resize", lambda *_: None)  # and at once, where it hears of it much later
        for row in range(3):
            screen.session.table.edit([row], Field.DIVIDER, 7 + row)
        await screen.press("a", shows="Discard all edits")


class SlowDemo:
    """A demo whose logger isn't there yet; `said` is why it ended."""

    said, farewell = "", ""

    def start(self):
        pass

    def stop(self):
        pass

    def owns(self, pid):
        return False

    def ended(self):
        return self.said


async def test_while_the_demo_starts_the_cursor_is_on_no_logger_of_others(fake, opened):
    async with opened(fake, demo=SlowDemo(), ready=False) as screen:
        await screen.shows("What is listed is another one.")
        lister = screen.app.screen
        assert (lister.lines.highlighted, lister.chosen) == (None, None)
        offered = screen.text.splitlines()[-1]
        assert not any(key in offered for key in ("Enter", "Start/Stop", "Save", "Mark")), offered
        await screen.press("enter", "S")
        await screen.settled()
        assert screen.app.screen is lister and not fake.calls
        await screen.press("j")  # who wants one of them goes there
        await screen.until(lambda: lister.chosen is not None)
        await screen.until(lambda: "Enter" in screen.text.splitlines()[-1])


async def test_while_the_demo_starts_nobody_is_told_that_no_logger_runs(opened):
    demo = SlowDemo()
    async with opened(demo=demo, ready=False) as screen:
        await screen.shows("The demo is starting: a simulated legged robot, which opens here by itself.")
        assert "No logger is running" not in screen.text
        demo.said = "The demo ended with exit code 1:\nno room"
        await screen.shows("The demo ended with exit code 1")
        assert screen.text.index("no room") < screen.text.index("No logger is running")  # first what is wrong
        await screen.shows("No logger is running")


async def test_why_a_demo_can_t_be_opened_is_told_above_and_not_that_it_will_open(
    fake, new_finder, opened, monkeypatch
):
    def lost(*_):
        raise ConnectionLostError(why)

    why, demo = "its helper process ended", SlowDemo()
    monkeypatch.setattr(new_finder, "connect", lost)
    monkeypatch.setattr(demo, "owns", lambda pid: True)
    async with opened(fake, demo=demo, ready=False) as screen:
        await screen.until(lambda: screen.app.screen.scope == "loggers" and why in screen.text)
        screen.app._opener._finder.members["robot"] = Member(fake.found, problem=why)
        await screen.until(lambda: any(one.member.problem for one in getattr(screen.app.screen, "found", ())))
        await screen.press("j")
        await screen.until(lambda: screen.app.screen.scope == "loggers" and why in screen.text)
        assert (screen.text.count(why), "is starting" in screen.text) == (2, False)  # in its line of the list, too


async def test_what_shines_through_a_dialog_is_painted_anew_with_it(monkeypatch, screen):
    table, below, above = (
        screen.app.screen,
        Question("One", "", [Choice("", "Close")]),
        Question("Other", "", [Choice("", "Close")]),
    )
    for dialog in (below, above):
        await screen.app.push_screen(dialog)
    painted = []
    for each in (table, below):
        monkeypatch.setattr(each, "_set_dirty", lambda *_, each=each: painted.append(each))
    above.refresh()
    assert painted == [below]


async def test_tab_says_what_else_a_line_may_become(screen, size=(100, 40)):
    await screen.press("slash")
    await screen.type("/legs/LF/H")
    await screen.press("tab", shows="Tab again: /legs/LF/HFE")
    assert screen.app.screen.query_one("#filter-line").value == "/legs/LF/HAA"
    await screen.press("tab", shows="Tab again: /legs/LF/HAA")
    await screen.type("/nowhere")
    await screen.press("tab", shows="nothing completes it")
    await screen.press("escape", "colon")
    await screen.type("st")
    await screen.press("tab", shows="Tab again: stop")


async def test_the_choices_of_a_question_are_in_sight_however_long_its_title_and_what_it_tells_are(fake, opened):
    """The last ones stood below the end of a terminal of 80x24."""
    words = ["Apply and go on", "Keep", "Save, stop, apply", "Drop 9 samples", "Discard"]

    async def newer():
        return [Choice(str(at), f"{each} {'of all that is held ' * 4}", "") for at, each in enumerate(words)]

    async with opened(fake) as screen:
        choices = [Choice(str(at), each) for at, each in enumerate(words)]
        title = f"Apply 12 edits to 6 elements of {'a robot with a long name ' * 3}?"
        body = "\n".join(str(line) for line in range(100))
        screen.app.push_screen(Question(title, body, choices, newer=newer))
        await screen.shows("Discard")
        await screen.shows("Discard of all that is held")
        for each in words:
            await screen.shows(each)
