"""The `:` line and the commands that need no screen, without one: what they do, and what they say."""

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.conditions import Derived
from silo.errors import RefusedError
from silo.rpc.refusals import RefusedWhy
from silo_tui.commands import view_flows
from silo_tui.commands.runner import CommandRunner
from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.layouts.presets import BY_NAME
from silo_tui.layouts.texts import write
from silo_tui.model.words.command_line import BY_KEY, read
from tests.stand_ins.desk import ESC, Desk, Line, Plain, Sheet
from tests.stand_ins.fake_signals import refused


@pytest.fixture
def shown(monkeypatch):
    """What is put on the screen; of a view that has plots, something is missing."""
    found: list[KeptLayout] = []

    async def show(context: Any, layout: KeptLayout) -> str:
        found.append(layout)
        context.session.rows.set_filter(layout.filter)
        return "not on this logger: 1 of 1 plots" if layout.plots else ""

    monkeypatch.setattr(views, "show", show)
    return found


def typed(desk: Desk, line: str) -> str:
    """What is said of a line."""
    command = read(line)
    getattr(CommandRunner(desk), f"command_{command.word}")(command)
    return desk.said[-1]


# ------------------------------------------------------------------------------------------------------------- views

ONE, PLOTS = KeptLayout(filter="one"), KeptLayout(plots=(("a",), ("b",)))


def test_a_view_is_kept_by_its_name_and_a_second_time_over_the_first(fake, monkeypatch):
    desk = Desk(fake)
    for layout, words in ((ONE, "kept"), (PLOTS, "written over with 2 plots")):
        monkeypatch.setattr(views, "capture", lambda _, layout=layout: layout)
        assert typed(desk, "view save my walk") == (
            f"view my walk {words}: `:view my walk` opens it, or silo-tui --view my walk"
        )
        assert files.load("my walk")[0] == layout


def test_without_a_screen_there_is_no_view_to_keep(fake, monkeypatch):
    monkeypatch.setattr(views, "capture", lambda _: None)
    with pytest.raises(RefusedError, match="nothing to keep"):
        typed(Desk(fake), "view save a")


@pytest.mark.parametrize("name", ["walk", "save", "hottest", "near-limit"])
def test_a_view_that_was_kept_is_opened_by_its_name_though_another_has_it(name, fake, shown):
    files.save(files.place(name), ONE)
    assert typed(Desk(fake), f"view {name}") == f"view {name}"
    assert shown == [ONE]


def test_what_a_logger_lacks_of_a_view_is_told(fake, shown):
    files.save(files.place("walk"), PLOTS)
    assert typed(Desk(fake), "view walk") == "view walk; not on this logger: 1 of 1 plots"


def test_what_was_left_out_of_the_file_of_a_view_is_told(fake, shown):
    files.save(files.place("walk"), ONE)
    files.place("walk").write_text(files.place("walk").read_text() + "\nsmell: nice\ntaste: sweet\n")
    said = typed(Desk(fake), "view walk")
    assert said.startswith("view walk; ")
    assert ("smell" in said) is not ("taste" in said)


def test_a_view_of_the_robot_is_opened_by_its_name_alone_where_no_other_has_it(fake, shown):
    fake.views_kept = {"walk": write(ONE), "run": write(PLOTS)}
    files.save(files.place("run"), ONE)
    desk = Desk(fake)
    assert typed(desk, "view walk") == "view robot:walk"
    assert typed(desk, "view run") == "view run"
    assert typed(desk, "view robot:run") == "view robot:run; not on this logger: 1 of 1 plots"
    assert shown == [ONE, ONE, PLOTS]


def test_a_view_that_nobody_has_is_refused_with_those_that_are_near(fake, shown):
    files.save(files.place("walk"), ONE)
    with pytest.raises(RefusedError, match=r"there is no view 'wall'; did you mean 'walk'"):
        typed(Desk(fake), "view wall")


def test_what_was_left_is_opened_by_its_name_unless_a_view_has_that(fake, shown):
    desk = Desk(fake)
    with pytest.raises(RefusedError, match="there is no view 'last'"):
        typed(desk, "view last")
    desk.left_view = files.LeftLayout(files.left_by_us("robot"), time.time_ns(), ONE, [])
    assert typed(desk, "view last").startswith("this is what was on the screen ")
    files.save(files.place("last"), PLOTS)
    typed(desk, "view last")
    assert shown == [ONE, PLOTS]


@pytest.mark.parametrize("before", ["imu", "nothing-like-it"])
def test_a_view_that_is_always_there_is_of_all_whatever_the_filter_shows(before, fake, shown):
    desk = Desk(fake)
    desk.session.rows.set_filter(before)
    assert typed(desk, "view hottest").startswith("view hottest: temperatures"), "what is shown"
    assert shown == [BY_NAME["hottest"].layout]


def test_what_is_near_a_limit_is_looked_for_as_it_is_now(fake, shown):
    fake.limit_statuses = [
        LimitStatus(
            "/log/imu/temperature", "/log/imu/temperature", LimitWord.OK, bounds=(None, None, 9.0, None), value=8.9
        )
    ]
    said = typed(Desk(fake), "view near-limit")
    assert said == "1 of 1 signal with limits is within a tenth of one, or beyond"
    assert shown[0].filter == "~/log/imu/temperature$"


def test_views_are_listed_with_those_of_the_robot(fake):
    desk = Desk(fake)
    always = f"; always there: {', '.join(BY_NAME)}"
    assert typed(desk, "view").startswith("no views yet; `:view save NAME` makes one")
    files.save(files.place("walk"), ONE)
    fake.views_kept = {"run": write(ONE)}
    assert typed(desk, "view") == f"views: walk, robot:run{always}"
    desk.session.link = None
    with pytest.raises(RefusedError):
        desk.session.connection.call(len)


@pytest.mark.parametrize(
    ("exists", "answers", "kept"), [(False, (), True), (True, ("y",), True), (True, (ESC,), False)]
)
def test_a_view_is_kept_on_the_robot_and_over_another_after_a_question(exists, answers, kept, fake, monkeypatch):
    monkeypatch.setattr(views, "capture", lambda _: ONE)
    fake.views_kept = {"walk": write(PLOTS)} if exists else {}
    desk = Desk(fake, *answers)
    CommandRunner(desk).command_view(read("view save robot:walk"))
    told = [
        "view kept on the robot: /home/ann/config/views/walk.yaml: `:view robot:walk` opens it, or silo-tui --view "
        "robot:walk"
    ]
    assert desk.said == told * kept
    assert fake.views_kept == {"walk": write(ONE if kept else PLOTS)}
    assert [each.partition("?")[0] for each in desk.asked] == ["Write over view walk"] * exists


def test_a_robot_that_can_t_keep_a_view_says_why(fake, monkeypatch):
    def refuses(*_: Any, **__: Any) -> None:
        raise refused(RefusedWhy.FAILED, "the disk is full")

    monkeypatch.setattr(views, "capture", lambda _: ONE)
    fake._keep_view = refuses
    with pytest.raises(RefusedError, match="disk is full"):
        typed(Desk(fake), "view save robot:walk")


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        (("h",), ["view hottest: temperatures, highest on top now; rows then stay"]),
        (("1",), ["view gait"]), (("2",), ["view walk"]), (("r", "1"), ["view robot:run"]),
        (("r", ESC), []), ((ESC,), []),
    ],
)  # fmt: skip
def test_what_to_look_at_is_chosen_by_a_letter_or_a_digit(answers, said, fake, shown):
    files.save(files.place("walk"), ONE)
    files.save(files.place("gait"), ONE)
    fake.views_kept = {"run": write(ONE)}
    desk = Desk(fake, *answers)
    CommandRunner(desk).command_view(BY_KEY)
    assert desk.said == said
    assert desk.asked[0].endswith(
        "(1) View gait\n(2) View walk\n(r) Views that the robot keeps\n(w) Keep what is on the screen, by a name"
    )


def test_of_ten_views_the_tenth_has_no_digit():
    assert [each.key for each in view_flows.numbered([f"v{at}" for at in range(11)])] == [*"123456789", "", ""]


def test_a_robot_without_views_says_how_one_is_kept(fake):
    with pytest.raises(RefusedError, match="`:view save robot:NAME` keeps what is on the screen"):
        CommandRunner(Desk(fake, "r")).command_view(BY_KEY)


def test_what_is_on_the_screen_is_kept_by_a_name_that_is_typed(fake, monkeypatch):
    desk, begun = Desk(fake, "w"), []
    monkeypatch.setattr(Desk, "upper_screen", SimpleNamespace(begin_command=begun.append), raising=False)
    CommandRunner(desk).command_view(BY_KEY)
    assert begun == ["view save"]


def test_where_there_is_no_link_no_views_of_the_robot_are_offered(fake):
    desk = Desk(fake, ESC)
    desk.session.link = None
    CommandRunner(desk).command_view(BY_KEY)
    assert "robot keeps" not in desk.asked[0]


# ----------------------------------------------------------------------------------------------------------- picture


@pytest.mark.parametrize(
    ("line", "name", "note"),
    [
        ("picture", "silo-tui.svg", ""),
        ("picture a", "a.svg", " (an SVG: browsers open it)"),
        ("picture a.svg", "a.svg", ""),
        ("picture a.PNG", "a.svg", " (an SVG: browsers open it)"),
        ("picture run.2", "run.2.svg", " (an SVG: browsers open it)"),
    ],
)
def test_a_picture_is_an_svg_whatever_it_is_called(line, name, note, fake, monkeypatch):
    monkeypatch.setattr("silo_tui.screens.dialogs.exporting.picture", lambda _: "<svg/>")
    assert typed(Desk(fake), line) == f"picture of the screen: {Path(name).absolute()}{note}"
    assert Path(name).read_text() == "<svg/>"


def test_a_picture_that_can_t_be_written_says_why(fake, monkeypatch):
    monkeypatch.setattr("silo_tui.screens.dialogs.exporting.picture", lambda _: "<svg/>")
    assert typed(Desk(fake), "picture none/a.svg").startswith("failed: can't write the picture: [Errno 2]")


# ------------------------------------------------------------------------------------------------------------ themes


@pytest.mark.parametrize(
    ("line", "answers", "theme", "said"),
    [
        ("theme light", (), "silo-light", "theme: light; g s w writes it to the file"),
        ("theme nord", (), "nord",
         "theme: nord, until silo-tui ends; g s w keeps none but dark, light, contrast, 16"),
        ("theme", ("c",), "silo-contrast", "theme: contrast; g s w writes it to the file"),
    ],
)  # fmt: skip
def test_a_theme_is_chosen_by_its_word_or_its_letter(line, answers, theme, said, fake):
    desk = Desk(fake)
    desk.theme, desk.available_themes, taken = "silo-dark", {"nord": 1, "silo-dark": 1, "silo-light": 1}, []
    desk.take_settings = taken.append
    desk.app.app = desk  # as a screen has one

    def push_screen(dialog: Any, then: Any) -> None:
        assert dialog._choices[dialog._begin].value == "dark"
        then(next(each.value for each in dialog._choices if each.key == answers[0]))

    desk.push_screen = push_screen
    typed(desk, line)
    assert (desk.theme, desk.said[-1]) == (theme, said)
    assert [each.theme for each in taken] == [theme.removeprefix("silo-")] * theme.startswith("silo-")


def test_a_theme_that_is_none_is_refused_with_those_that_are(fake):
    desk = Desk(fake)
    desk.available_themes = {"nord": 1, "silo-dark": 1, "gruvbox": 1}
    with pytest.raises(ValueError, match=r"themes: dark, light, contrast, 16; Textual's: gruvbox, nord$"):
        typed(desk, "theme dark light")


@pytest.mark.parametrize(("given", "asked"), [(BY_KEY, 1), (read("save walk"), 0), (read("save"), 0)])
def test_a_script_is_saved_by_a_name_that_is_asked_for_by_its_key_alone(given, asked, fake, monkeypatch):
    monkeypatch.setattr("silo_tui.commands.flows.Prompt", Line)
    desk = Desk(fake, *["walk"] * asked)
    CommandRunner(desk).command_save_script(given)
    assert (len(desk.asked), fake.calls) == (
        asked,
        [("save_script", "walk.yaml" if given.word != "save" or given.arguments else "", False)],
    )


# ------------------------------------------------------------------------------------------- lines, their completion


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (":stat", "failed: there is no command 'stat'; did you mean 'start', 'stop'?"),
        (":abcxyz", "failed: there is no command 'abcxyz'; `:help` shows what there is"),
        (":start", "failed: no logger is open"),
        (":", "failed: an empty command; `:help` lists them"),
    ],
)
def test_a_line_that_can_t_be_carried_out_says_why(line, says, fake):
    desk = Desk(fake)
    CommandRunner(desk).run(line)
    assert desk.said == [says]


class Asked(Sheet):
    """A screen that keeps what it is asked to do."""

    def action_command(self, command_id: str, typed: Any = None) -> None:
        self.told.append(f"{command_id} {typed.rest}".strip())


@pytest.mark.parametrize(
    ("screens", "line", "by", "does"),
    [
        ("table", "restart", 0, "restart"),
        ("table monitor", "restart", 0, "restart"),  # the plots have it, but the table too
        ("table triggers", "load x", 0, "load_script x"),
        ("table monitor", "theme light", 1, "theme light"),
        ("table monitor", "goto a b", 1, "goto a b"),
        ("table file", "theme light", 1, "theme light"),
        ("table file file_monitor", "theme light", 2, "theme light"),
        ("table file file_monitor", "filter a", 2, "filter a"),
        ("table file table", "filter a", 2, "filter a"),
        ("loggers", "restart", None, "no logger is open"),
        ("table file", "restart", None, ":restart: a saved file: nothing to edit, no logger to command"),
    ],
)
def test_a_line_is_carried_out_by_the_uppermost_screen_that_can_else_by_the_table(screens, line, by, does, fake):
    desk = Plain(fake)
    desk.screen_stack = [Asked() for _ in screens.split()]
    for sheet, scope in zip(desk.screen_stack, screens.split(), strict=True):
        sheet.scope = scope
    CommandRunner(desk).run(f":{line}")
    told = [sheet.told for sheet in desk.screen_stack]
    at = len(told) - 1 if by is None else by
    assert told[at] == [does if by is not None else f"failed: {does}"]
    assert not [words for other, words in enumerate(told) if other != at and words]


def test_a_screen_that_has_a_command_itself_is_asked_before_the_table(fake):
    desk = Plain(fake)
    desk.screen_stack = [Asked(), Asked()]
    desk.screen_stack[1].scope = "events"
    desk.screen_stack[1].command_sort = True
    CommandRunner(desk).run(":sort div")
    assert desk.screen_stack[1].told == ["sort div"]


@pytest.mark.parametrize(
    ("command", "answers", "said"),
    [("restart", ("D",), "restarted"), ("apply", (), "nothing is pending"), ("try_link", (), "the link is there")],
)
def test_a_key_begins_its_flow(command, answers, said, fake):
    desk = Desk(fake.run(), *answers)
    getattr(CommandRunner(desk), f"command_{command}")()
    assert desk.said == [said]


@pytest.mark.parametrize("line", ["open", "open {}", "open {}/"])
def test_of_a_folder_one_chooses_what_is_opened_in_its_list(line, fake, tmp_path):
    listed = []
    desk = Desk(fake)
    desk.app.command_runs = lambda folder: (listed.append(folder.rest), desk.say("listed"))
    typed(desk, line.format(tmp_path))
    assert listed == [line.format(tmp_path).partition(" ")[2]]


def test_without_a_logger_it_is_told_how_a_file_is_opened(fake):
    desk = Desk(fake)
    desk.take_session(None)
    with pytest.raises(RefusedError, match="open the file by `silo-tui FILE`"):
        typed(desk, "open a.silo")


@pytest.mark.parametrize(
    ("line", "lines"),
    [
        (":contr", ["control"]),
        (":control ", ["control take", "control force", "control release", "control give"]),
        (":data csv cs", []),
        (":data c", ["data csv"]),
        (":view no", ["view noisiest"]),
        (":view wa", ["view walk"]),
        (":view save ho", []), (":view save ", ["view save walk"]),  # none of silo's own is what one keeps
        (":goto /log/imu/t", ["goto /log/imu/temperature"]),
        (":goto /imu/t", ["goto /imu/temperature"]),  # as the table has it
        (":goto temp imu", ["goto /imu/temperature", "goto /log/imu/temperature"]),  # words as those of a filter
        (":load q", ["load quiet.yaml"]),
        (":nothing a", []),
    ],
)  # fmt: skip
def test_a_line_is_completed_by_what_it_may_become(line, lines, fake):
    files.save(files.place("walk"), ONE)
    desk = Desk(fake)
    desk.available_themes = {}
    desk.script_names = ("quiet.yaml", "robot.yaml")
    assert CommandRunner(desk).complete(line) == lines


def test_a_derived_signal_completes_a_line_as_the_table_has_it(fake):
    fake.derived = (Derived("/log/power", "2 * imu/acceleration"),)
    assert CommandRunner(Desk(fake)).complete(":derive /") == ["derive /power"]


@pytest.mark.parametrize("line", ["goto /log/imu/t", "sort di"])
def test_without_a_logger_nothing_of_it_completes_a_line(line, fake):
    desk = Desk(fake)
    assert CommandRunner(desk).complete(line)
    desk.take_session(None)
    assert CommandRunner(desk).complete(line) == []
