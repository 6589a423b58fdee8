"""What takes several steps, without a screen: what each asks, what the answers do, what is said in the end."""

import asyncio
from functools import partial
from typing import Any

import msgspec
import pytest

from silo.client.bulk import Outcome
from silo.conditions.standing import TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import BufferType, Control, FileType, Present, RecorderState, State
from silo.core.quantities.writing import wall_clock
from silo.errors import RefusedError
from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from silo.recorder.requests import RecorderInfo
from silo.rpc.published import Summary
from silo.rpc.refusals import RefusedWhy
from silo_tui.commands import flows, many
from silo_tui.commands.flows import control_flow
from silo_tui.commands.runner import CommandRunner
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.model.table.fields import Field
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.screens.dialogs.questions import Question
from silo_tui.screens.dialogs.scripts import AS_BEGUN
from silo_tui.sessions import kept
from silo_tui.sessions.live import Session
from tests.stand_ins.desk import ESC, LEFT, NAME, SAVED, Desk, Line
from tests.stand_ins.fake_logger import FakeClient
from tests.stand_ins.fake_signals import refused


@pytest.fixture(autouse=True)
def lines_without_an_app(monkeypatch):
    monkeypatch.setattr(flows, "Prompt", Line)
    monkeypatch.setattr(many, "Prompt", Line)


@pytest.fixture
def unsaved(fake):
    """A logger that stopped, and holds what is in no file."""
    fake.run()
    fake.state = State.STOPPED
    return fake


@pytest.fixture
def saved(unsaved):
    """One that stopped, and whose data is in a file."""
    unsaved.saved = True
    return unsaved


@pytest.fixture
def edited(saved):
    """One that has an element otherwise than its program began with."""
    first = saved.elements[0]
    saved.given = {first.name: msgspec.structs.replace(first.options, divider=first.options.divider + 1)}
    return saved


@pytest.fixture
def running(fake):
    return fake.run()


# ------------------------------------------------------------------------------------------------ starting, stopping

NOT_SAVED = "stopped and not saved: nothing else was done, the data is still there (w saves it)"
IN_FILE = f"; saved: {SAVED.path} (1.23 MB)"


@pytest.mark.parametrize(
    ("state", "flow", "answers", "done", "said"),
    [
        ("saved", flows.start_stop, (), "start", "started"),
        ("unsaved", flows.start_stop, ("s", ""), "save start", f"started{IN_FILE}"),
        ("unsaved", flows.start_stop, ("s", LEFT), "", ""),
        ("unsaved", flows.start_stop, ("D",), "start", "started"),
        ("unsaved", flows.start_stop, (ESC,), "", ""),
        ("running", flows.start_stop, (ESC,), "", ""),
        ("running", flows.start_stop, ("y",), "stop", "stopped; w saves the data"),
        ("running", flows.start_stop, ("s", ""), "stop save", ""),
        ("running", flows.start_stop, ("s", LEFT), "stop", NOT_SAVED),
        ("running", flows.start_stop, ("r", ESC), "", ""),
        ("running", flows.start_stop, ("r", "D"), "stop start", "restarted"),
        ("running", flows.restart, (ESC,), "", ""),
        ("running", flows.restart, ("D",), "stop start", "restarted"),
        ("running", flows.restart, ("s", ""), "stop save stop start", f"restarted{IN_FILE}"),
        ("running", flows.restart, ("s", LEFT), "stop", NOT_SAVED),
        ("saved", flows.restart, (), "stop start", "restarted"),
        ("unsaved", flows.restart, ("D",), "stop start", "restarted"),
        ("unsaved", flows.restart, (ESC,), "", ""),
    ],
)
def test_a_start_and_a_stop_ask_what_becomes_of_the_data_and_do_no_more_than_that(
    state, flow, answers, done, said, request
):
    desk = Desk(request.getfixturevalue(state), *answers)
    assert (desk.does(flow(desk)), desk.done) == (said, done)


def test_what_runs_and_is_saved_is_restarted_by_a_yes(running):
    running.saved = True
    desk = Desk(running, "y")
    assert desk.does(flows.restart(desk)) == "restarted"
    assert desk.asked == ["Restart logging?\nStopping ends this run.\n() Don't restart\n(y) Restart"]


def test_a_question_about_data_says_how_much_there_is(unsaved):
    desk = Desk(unsaved, ESC)
    desk.does(flows.start_stop(desk))
    held = desk.asked[0].partition("recording (")[2].partition(")")[0]
    assert desk.asked == [
        f"Start again?\nThe last recording ({held}) is not saved, and starting drops it."
        f"\n(s) Save it, then start\n() Don't start\n(D) Drop {held} and start!"
    ]
    status = desk.session.status
    assert held == f"{status.held_samples:,}".replace(",", " ") + " samples, 10 s at most"


def test_a_logger_that_never_ran_has_nothing_to_lose(fake):
    fake.saved = False
    desk = Desk(fake)
    assert desk.does(flows.start_stop(desk)) == "started"


# ---------------------------------------------------------------------------------------------------------- applying


@pytest.mark.parametrize(
    ("state", "answers", "done", "said"),
    [
        ("saved", ("a",), "apply", "applied to 1 element; u takes it back, as edits to apply"),
        ("saved", (ESC,), "", ""),
        ("saved", ("x",), "", "all pending edits discarded; u brings them back"),
        ("running", ("a",), "cut", "applied to 1 element, it goes on; u takes it back, as edits to apply"),
        ("running", (ESC,), "", ""),
        ("running", ("x",), "", "all pending edits discarded; u brings them back"),
        ("running", ("D",), "stop apply start",
         "applied to 1 element, logging again; u takes it back, as edits to apply"),
        ("running", ("s", ""), "stop save apply start",
         f"applied to 1 element, logging again; u takes it back, as edits to apply{IN_FILE}"),
        ("running", ("s", LEFT), "stop", NOT_SAVED),
    ],
)  # fmt: skip
def test_edits_are_applied_as_the_answer_says(state, answers, done, said, request):
    desk = Desk(request.getfixturevalue(state), *answers).edit()
    assert (desk.does(flows.apply(desk)), desk.done) == (said, done)
    stay = not said or said == NOT_SAVED
    assert desk.session.table.pending_count == (stay, stay)
    if answers == ("x",):
        desk.session.table.undo()
        assert desk.session.table.pending_count == (1, 1)


def test_of_no_edits_nothing_is_asked(saved):
    desk = Desk(saved)
    assert desk.does(flows.apply(desk)) == "nothing is pending"


def test_what_applying_asks_counts_edits_and_elements_and_says_what_goes_on(running):
    running.saved = True
    desk = Desk(running, "r").edit()
    desk.session.table.edit([desk.session.table.row(NAME)], Field.SIZE, 50)
    desk.edit("/log/imu/temperature")
    assert desk.does(flows.apply(desk)).startswith("applied to 2 elements, logging again")
    assert desk.asked[0].startswith(
        "Apply 3 edits to 2 elements?\nApply and go on saves what its buffers hold (looping ones: the newest alone) "
        "and begins them empty. Stopping ends this run.\n"
    )
    assert desk.asked[0].endswith(
        "\n(a) Apply and go on: no tick is lost\n() Keep them pending; to drop one: e x on its line"
        "\n(r) Stop, apply, start again\n(x) Discard all edits; u brings them back"
    )


def conflict(fake: FakeClient, *answers: str) -> Desk:
    """Somebody else changes what is being edited, and our table knows."""
    desk = Desk(fake, *answers).edit()
    fake.somebody_edits(NAME, divider=7)
    asyncio.run(desk.session.reload())
    desk.table_changed()
    return desk


@pytest.mark.parametrize(
    ("answers", "done", "said"),
    [
        ((ESC,), "", ""),
        (("t",), "", "nothing is pending any more"),
        (("y", "a"), "apply", "applied to 1 element; u takes it back, as edits to apply"),
    ],
)
def test_what_somebody_else_changed_meanwhile_is_settled_first(answers, done, said, saved):
    desk = conflict(saved, *answers)
    assert (desk.does(flows.apply(desk)), desk.done) == (said, done)
    assert "Settle 1 conflict?" in desk.asked[0]
    assert "orientation\n  divider: was 1, theirs 7, yours 5\n" in desk.asked[0]
    assert saved.info(NAME).options.divider == (5 if done else 7)


@pytest.mark.parametrize(("count", "more"), [(200, ""), (201, "and 1 more\n")])
def test_of_many_conflicts_the_first_are_listed_and_the_rest_counted(count, more, wide_table, new_fake):
    fake = new_fake(wide_table(count))
    desk = Desk(fake, ESC)
    desk.session.table.edit(range(count), Field.DIVIDER, 5)
    fake.elements = [
        msgspec.structs.replace(one, options=msgspec.structs.replace(one.options, divider=7)) for one in fake.elements
    ]
    fake.revision += 1
    asyncio.run(desk.session.reload())
    desk.table_changed()
    desk.does(flows.apply(desk))
    assert desk.asked[0].count("theirs 7") == 200
    assert f"yours 5\n{more}\n(" in desk.asked[0]


def test_who_was_slower_is_told_and_asked_again(saved):
    desk = Desk(saved, "a", ESC).edit()
    saved.connected = False  # its event comes late
    saved.somebody_edits("/log/imu/temperature", divider=7)
    saved.connected = True
    assert desk.does(flows.apply(desk)) == "somebody else changed the table meanwhile: look again"
    assert [each.partition("?")[0] for each in desk.asked] == ["Apply 1 edit to 1 element"] * 2


def test_who_was_slower_around_a_stop_has_it_running_again(running):
    desk = Desk(running, "D", ESC).edit()
    running.connected = False
    running.somebody_edits("/log/imu/temperature", divider=7)
    running.connected = True
    assert desk.does(flows.apply(desk)) == "somebody else changed the table meanwhile: look again"
    assert desk.done == "stop apply start"
    assert running.state is State.RUNNING


def test_a_logger_that_somebody_else_started_meanwhile_is_asked_about_anew(saved):
    desk = Desk(saved, "a", "a").edit()
    saved.run()
    assert desk.does(flows.apply(desk)) == "applied to 1 element, it goes on; u takes it back, as edits to apply"
    assert desk.done == "apply cut"
    assert "Apply and go on" not in desk.asked[0]
    assert "Apply and go on" in desk.asked[1]


@pytest.mark.parametrize("answer", ["a", "D"])
def test_what_is_refused_is_told_and_the_logger_runs_again(answer, running):
    def refuses(*_: Any, **__: Any) -> None:
        raise refused(RefusedWhy.INVALID, "the size is too large")

    desk = Desk(running, answer).edit()
    running.apply = refuses
    with pytest.raises(RefusedError, match="too large"):
        desk.does(flows.apply(desk))
    assert running.state is State.RUNNING
    assert desk.session.table.pending_count == (1, 1)


@pytest.mark.parametrize(
    ("fired", "words"),
    [
        ("", ""),
        ("a", " 'a', fired already, then watches again."),
        ("a b", " 'a' and 'b', fired already, then watch again."),
        ("a b c", " 'a' and 'b' and 'c', fired already, then watch again."),
        ("a b c d", " 'a' and 'b' and 'c' ..., fired already, then watch again."),
    ],
)
def test_a_new_run_has_triggers_watch_again_that_fired(fired, words, running):
    desk = Desk(running, ESC).edit()
    options = [(name, TriggerWord.FIRED) for name in fired.split()] + [("armed", TriggerWord.ARMED)]
    desk.session.triggers = [TriggerStatus(TriggerOptions(name, "x > 1"), word) for name, word in options]
    desk.does(flows.apply(desk))
    assert f"begins them empty.{words} Stopping ends" in desk.asked[0]


def test_what_is_likely_not_meant_is_told_with_what_was_applied(saved):
    desk = Desk(saved, "a").edit()
    apply = saved.apply
    saved.apply = lambda *given, **named: msgspec.structs.replace(
        apply(*given, **named), warnings=["large", "trigger 'slip': '/log/imu/temperature' holds less"]
    )
    said = desk.does(flows.apply(desk))
    assert said == (
        "applied to 1 element; large; trigger 'slip': '/log/imu/temperature' holds less; "
        "u takes it back, as edits to apply"
    )


ENDS = (
    f"logging stops by itself after 10 s (max_time), as not all buffers are looping ({NAME}): for a run without end "
    "give max_time=0, or make them looping"
)


def ending(fake: FakeClient, *answers: str) -> Desk:
    """Nothing ends this logger yet, and `max_time` would."""
    fake.max_time_s = 10.0
    replace = msgspec.structs.replace
    fake.elements = [replace(one, options=replace(one.options, buffer=BufferType.LOOPING)) for one in fake.elements]
    return Desk(fake, *answers)


def test_what_has_a_logger_stop_by_itself_is_told_before_and_after(running):
    desk = ending(running, "a")
    desk.session.table.edit([desk.session.table.row(NAME)], Field.BUFFER, int(BufferType.GROWING))
    said = desk.does(flows.apply(desk))
    assert said == f"applied to 1 element, it goes on; {ENDS}; u takes it back, as edits to apply"
    (asked,) = desk.asked
    assert f"\n{ENDS[0].upper()}{ENDS[1:]}.\n" in asked
    assert "until it stops by itself" in asked
    assert "until memory is full" not in asked
    assert "(a) Apply and go on: no tick is lost until it stops, after 10 s\n" in asked


def test_what_ended_by_itself_before_too_is_not_told_of_again(running):
    desk = ending(running)
    for buffer, size in ((BufferType.GROWING, 50), (BufferType.GROWING, 60)):
        desk.session.table.edit([desk.session.table.row(NAME)], Field.BUFFER, int(buffer))
        desk.session.table.edit([desk.session.table.row(NAME)], Field.SIZE, size)
        desk.table_changed()
        desk.answers.append("a")
        said = desk.does(flows.apply(desk))
    assert said == "applied to 1 element, it goes on; u takes it back, as edits to apply"
    assert ENDS[1:] not in desk.asked[1]
    assert "until it stops by itself" in desk.asked[1]


def test_a_start_of_what_stops_by_itself_says_so(saved):
    desk = ending(saved, "a")
    desk.session.table.edit([desk.session.table.row(NAME)], Field.BUFFER, int(BufferType.GROWING))
    assert f"; {ENDS}; u takes" in desk.does(flows.apply(desk))
    assert desk.does(flows.start_stop(desk)) == f"started; {ENDS}"
    desk.table_changed()
    desk.status_changed()
    desk.answers.append("y")
    assert desk.does(flows.restart(desk)) == f"restarted; {ENDS}"


# ----------------------------------------------------------------------------------------------------------- scripts


def test_a_script_with_which_a_run_ends_by_itself_says_so_before_it_is_loaded(running):
    desk = ending(running, "l", "l")
    running.files["once.yaml"] = (
        f"log_elements:\n  - name: {NAME}\n    enabled: true\n    buffer: {{type: growing, size: 50}}\n"
    )
    said = desk.does(flows.load_script(desk, "once"))
    told = f"{ENDS[0].upper()}{ENDS[1:]}.\n"
    first, second = desk.asked
    assert f"\n{told}It would change 1 element:" in first
    assert f"\n{told}Load and go on saves" in second
    assert "(l) Load and go on: no tick is lost until it stops, after 10 s\n" in second
    assert said.startswith("loaded once.yaml: 1 element changed; it goes on")


UNKNOWN = "; not in the table: 1 name of it"


@pytest.mark.parametrize(
    ("state", "path", "answers", "done", "said"),
    [
        ("saved", "quiet", ("l",), "load_script", f"loaded quiet.yaml: 1 element changed{UNKNOWN}"),
        ("saved", "quiet.yaml", (ESC,), "", ""),
        ("saved", "", ("quiet", "l"), "load_script", f"loaded quiet.yaml: 1 element changed{UNKNOWN}"),
        ("saved", "", (None,), "", ""),
        ("edited", "", ("/",), "", "1 edit back to what the program began with: a applies"),
        ("saved", "robot.yaml", (), "", "robot.yaml says what the logger has already: nothing to load"),
        ("running", "quiet", ("l", "l"), "load_script and go on",
         f"loaded quiet.yaml: 1 element changed{UNKNOWN}; it goes on"),
        ("running", "quiet", ("l", ESC), "", ""),
        ("running", "quiet", ("l", "D"), "stop load_script start",
         f"loaded quiet.yaml: 1 element changed{UNKNOWN}; logging again"),
        ("running", "quiet", ("l", "s", ""), "stop save load_script start",
         f"loaded quiet.yaml: 1 element changed{UNKNOWN}; logging again{IN_FILE}"),
        ("running", "quiet", ("l", "s", LEFT), "stop", NOT_SAVED),
    ],
)  # fmt: skip
def test_a_script_is_loaded_once_its_difference_was_seen(state, path, answers, done, said, request):
    desk = Desk(request.getfixturevalue(state), *answers)
    push = desk.push_screen_wait

    async def chosen(dialog: Any) -> Any:  # the list of scripts, whose choices have no keys
        if isinstance(dialog, Question) and dialog._title == "Load a script":
            name = desk.answers.pop(0)
            return f"{name}.yaml" if name and name != AS_BEGUN else name
        return await push(dialog)

    desk.push_screen_wait = chosen  # type: ignore[method-assign]
    assert (desk.does(flows.load_script(desk, path)), desk.done) == (said, done)


def test_a_script_that_changes_nothing_but_has_unknown_names_says_so(saved):
    saved.files["old.yaml"] = "log_elements:\n  - name: /log/old/thing\n    enabled: true\n"
    desk = Desk(saved)
    said = desk.does(flows.load_script(desk, "old"))
    assert said == f"old.yaml says what the logger has already: nothing to load{UNKNOWN}"


def test_what_a_script_changes_beside_elements_is_told_and_known(saved):
    saved.trigger_statuses = [TriggerStatus(TriggerOptions("fall", "imu/temperature > 1"), TriggerWord.ARMED)]
    saved.save_script("fall.yaml")
    saved.trigger_statuses = []
    desk = Desk(saved, "l")
    assert desk.does(flows.load_script(desk, "fall")) == "loaded fall.yaml: 0 elements changed; trigger fall"
    assert [one.options.name for one in desk.session.triggers] == ["fall"]


@pytest.mark.parametrize(("answers", "done"), [(("l", ESC), ""), (("l", "y"), "load_script")])
def test_a_script_over_pending_edits_is_asked_about(answers, done, saved):
    desk = Desk(saved, *answers).edit()
    desk.does(flows.load_script(desk, "quiet"))
    assert desk.done == done
    assert desk.asked[1].startswith("Load over pending edits?\n1 pending edit in 1 element stay pending on top")


def test_a_script_that_can_t_be_loaded_leaves_the_logger_running(running):
    def refuses(*_: Any, **__: Any) -> None:
        raise refused(RefusedWhy.INVALID, "no such thing")

    desk = Desk(running, "l", "D")
    running.load_script = refuses
    with pytest.raises(RefusedError, match="no such thing"):
        desk.does(flows.load_script(desk, "quiet"))
    assert running.state is State.RUNNING


@pytest.mark.parametrize(
    ("names", "words"), [("", ""), ("a a", "; a"), ("a b c", "; a, b, c"), ("a b c d", "; a, b, c and 1 more")]
)
def test_what_a_script_changes_beside_elements_is_told_by_name(names, words):
    changes = [flows.FieldChange(name, "condition", "x", "y") for name in names.split()]
    assert flows._conditions_words(changes) == words


SEES = "e l shows what differs"


@pytest.mark.parametrize(
    ("path", "answers", "done", "said"),
    [
        (
            "walk",
            (),
            ("save_script", "walk.yaml", False),
            "saved /home/ann/config/walk.yaml: scripts end in .yaml",
        ),
        ("walk.yml", (), ("save_script", "walk.yml", False), "saved /home/ann/config/walk.yml"),
        ("robot.yaml", ("y",), ("save_script", "robot.yaml", True), "saved /home/ann/config/robot.yaml"),
        ("robot.yaml", (ESC,), ("save_script", "robot.yaml", False), ""),
        (None, ("walk.yaml",), ("save_script", "walk.yaml", False), "saved /home/ann/config/walk.yaml"),
        (None, (None,), None, ""),
    ],
)
def test_a_table_is_saved_as_a_script_and_over_another_after_a_question(path, answers, done, said, saved):
    desk = Desk(saved, *answers)
    assert desk.does(flows.save_script(desk, path)) == said + (said and f"; {SEES}")
    assert (saved.calls[-1] if saved.calls else None) == done


def test_the_script_of_the_logger_itself_has_no_name(saved):
    saved.files[""] = ""
    desk = Desk(saved, "y")
    assert desk.does(flows.save_script(desk, "")) == f"saved /home/ann/config/; {SEES}"
    assert desk.asked[0].startswith("Overwrite the script?")


def test_a_script_has_no_pending_edits_and_says_so_before_and_after(saved):
    desk = Desk(saved, "walk.yaml").edit()
    said = desk.does(flows.save_script(desk))
    assert desk.asked == [
        "Save the script\nin /home/ann/config, on the robot\n"
        "robot.yaml is what the program reads when it starts again.\n"
        "1 pending edit will not be in it: apply them first.\nrobot.yaml"
    ]
    assert said == f"1 pending edit not in it; saved /home/ann/config/walk.yaml; {SEES}"


def test_a_refusal_to_save_a_script_that_is_about_something_else_is_told(saved):
    def refuses(*_: Any) -> None:
        raise refused(RefusedWhy.FAILED, "the disk is full")

    saved.save_script = refuses
    desk = Desk(saved)
    with pytest.raises(RefusedError, match="disk is full"):
        desk.does(flows.save_script(desk, "walk"))


# ----------------------------------------------------------------------------------------------------------- leaving

RECORDED = RecorderInfo("all", "/logs", RecorderState.RECORDING, [], 0, 0.0, 0, "part1.mcap", since_ns=1, by="ann")


@pytest.mark.parametrize(
    ("edited", "answers", "ends"), [(False, (), True), (True, ("y",), True), (True, (ESC,), False)]
)
def test_leaving_asks_where_edits_are_pending(edited, answers, ends, saved):
    desk, left = Desk(saved, *answers), []
    desk.left = lambda: left.append(True)
    if edited:
        desk.edit()
    desk.does(flows.leave(desk))
    assert (desk.ended, bool(left)) == (ends, ends)
    assert bool(desk.session.table.pending_count[0]) == (edited and not ends)
    if edited:
        assert desk.asked[0].startswith(
            "Quit without applying?\n1 pending edit in 1 element would be lost. The logger goes on."
        )


@pytest.mark.parametrize(("edited", "answer", "ends"), [(True, ESC, False), (False, ESC, False), (False, "y", True)])
def test_who_quits_is_asked_where_a_demo_ends_with_the_program(saved, edited, answer, ends):
    desk, left = Desk(saved, answer), []
    desk.left, desk.has_demo = lambda: left.append(True), lambda: True
    desk.does(flows.leave(desk.edit() if edited else desk))
    assert (desk.ended, bool(left)) == (ends, ends)
    title = "Quit without applying?" if edited else "Quit, and end the demo?"
    assert desk.asked[0].startswith(title)
    assert "The demo robot ends with silo-tui; what it logged is saved." in desk.asked[0]


@pytest.mark.parametrize("began", [True, False])
def test_a_demo_that_died_or_has_not_begun_ends_without_a_question(began, unsaved):
    desk = Desk(unsaved)
    desk.has_demo = lambda: True
    dead = msgspec.structs.replace(desk.session.status, state=State.DEAD)
    desk.session.take_status(dead) if began else desk.take_session(None)
    desk.does(flows.leave(desk))
    assert (desk.ended, desk.asked) == (True, [])


@pytest.mark.parametrize(
    ("state", "changes", "says"),
    [
        ("saved", {}, "robot is stopped"),
        ("fake", {"saved": False}, "robot is stopped"),
        ("unsaved", {}, "robot is stopped, and 4 800 ticks stand in no file: `silo save robot`"),
        ("running", {}, "robot logs on"),
        ("running", {"recorder_infos": [RECORDED]}, "robot logs on, 1 recording with it"),
        ("unsaved", {"state": State.DEAD}, "robot is dead"),
    ],
)
def test_how_a_logger_is_left_says_what_goes_on_and_what_no_file_has(state, changes, says, request):
    fake = request.getfixturevalue(state)
    for name, value in changes.items():
        setattr(fake, name, value)
    session = Desk(fake).session
    assert flows.left_words(session) == says
    if session.dead:
        session.left_files = [SAVED, SAVED]
        assert flows.left_words(session) == f"robot is dead: {SAVED.path}, {SAVED.path}"


def test_of_a_logger_that_never_answered_nothing_is_said():
    assert flows.left_words(Session("robot")) == ""


@pytest.mark.parametrize(("edited", "answers", "may"), [(False, (), True), (True, ("y",), True), (True, (ESC,), False)])
def test_another_logger_is_opened_after_a_question_where_edits_are_pending(edited, answers, may, saved):
    desk = Desk(saved, *answers)
    if edited:
        desk.edit()
    assert asyncio.run(flows.may_leave(desk)) is may
    assert bool(desk.session.table.pending_count[0]) == (edited and not may)


@pytest.mark.parametrize(
    ("answer", "pending", "file", "said"),
    [
        ("t", 2, True, "2 edits pending again; u takes that back"),
        ("D", 0, False, ""),
        (ESC, 0, True, ""),
    ],
)
def test_edits_that_a_lost_terminal_left_are_offered(answer, pending, file, said, saved):
    before = Desk(saved).edit().edit("/log/imu/temperature")
    edits = [*before.session.table.kept(), kept.KeptEdit("/log/gone", 1, 1, 5), kept.KeptEdit(NAME, len(Field), 1, 5)]
    path = kept.path_of("anymal", "robot")
    kept.keep(path, edits)
    desk = Desk(saved, answer)
    assert desk.does(flows.take_up_edits(desk)) == said
    assert (desk.session.table.pending_count[0], path.exists()) == (pending, file)
    assert desk.asked[0].startswith("Take up 4 edits of robot again?\nThey were pending when silo-tui ended, today ")
    assert "orientation" in desk.asked[0]
    assert "gone" not in desk.asked[0]


# ----------------------------------------------------------------------------------------------------------- control

MINE = Control("ann@here silo-tui 1", "@local me", 0, 0)
BOBS = Control("bob (proven) from desk2, silo-tui 2", "bob", 0, 0)
NOBODY = "nobody has control; connected: nobody"


@pytest.mark.parametrize(
    ("controlled", "words", "answers", "done", "said"),
    [
        (None, ("take",), (), ("take_control", False), "you have control of robot until you release it or leave; your "
         "own programs may still change it"),
        (None, (), ("t",), ("take_control", False), "you have control of robot until you release it or leave; your "
         "own programs may still change it"),
        (None, (), (ESC,), None, ""),
        (BOBS, (), ("F",), ("take_control", True), "you have control of robot until you release it or leave; your "
         "own programs may still change it"),
        (BOBS, ("force",), (), ("take_control", True), "you have control of robot until you release it or leave; your "
         "own programs may still change it"),
        (MINE, (), (ESC,), None, ""),
        (MINE, (), ("r",), None, "control of robot is released"),
        (MINE, ("release",), (), None, "control of robot is released"),
        (MINE, ("give", "bob"), (), None, "bob has control of robot"),
    ],
)  # fmt: skip
def test_control_is_taken_given_and_released(controlled, words, answers, done, said, saved):
    saved.controlled = controlled
    desk = Desk(saved, *answers)
    assert desk.does(control_flow(desk, words)) == said
    assert (saved.calls[-1] if saved.calls else None) == done
    assert desk.session.status.control == saved.controlled


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("tak",), "there is no 'tak'; did you mean 'take'"),
        (("xyz",), "there is no 'xyz'; take, force"),
        (("give",), "control: take, force"),
        (("take", "bob"), "control: take, force"),
        (("give", "bob", "too"), "control: take, force"),
    ],
)
def test_a_word_of_control_that_is_none_is_refused_with_what_there_is(words, why, saved):
    desk = Desk(saved)
    with pytest.raises(RefusedError, match=why):
        desk.does(control_flow(desk, words))


def test_who_may_not_edit_is_told_who_has_control_and_asked_nothing(saved):
    saved.may_edit = False
    saved.clients = [Present("bob@desk silo-tui 2", 0, "bob")]
    desk = Desk(saved)
    assert desk.does(control_flow(desk, ())).startswith("nobody has control; connected: bob@desk")
    assert desk.does(control_flow(desk, ("take",))).startswith("Control: ")
    assert not saved.calls


# ------------------------------------------------------------------------------------------------------ the `:` line


@pytest.mark.parametrize(
    ("state", "typed", "answers", "done", "said"),
    [
        ("running", Spelled("start", ()), (), "", "it is running already"),
        ("saved", Spelled("stop", ()), (), "", "it is stopped already"),
        ("saved", Spelled("start", ()), (), "start", "started"),
        ("running", Spelled("stop", ()), ("y",), "stop", "stopped; w saves the data"),
        ("saved", BY_KEY, (), "start", "started"),
    ],
)
def test_a_word_that_asks_for_what_is_so_already_says_so(state, typed, answers, done, said, request):
    desk = Desk(request.getfixturevalue(state), *answers)
    CommandRunner(desk).command_start_stop(typed)
    assert (desk.said[-1], desk.done) == (said, done)


# ----------------------------------------------------------------------------------------------------- many at once

STATES = {
    "r": (State.RUNNING, False), "R": (State.RUNNING, True), "u": (State.STOPPED, False), "s": (State.STOPPED, True),
}  # fmt: skip


class Asked:
    """A finder that keeps what is asked of whom; those called `c` refuse."""

    def __init__(self) -> None:
        self.jobs: list[str] = []

    def ask_many(self, loggers, job):
        kind = job if isinstance(job, partial) else partial(job)
        words = " ".join([kind.func.__name__, *map(str, kind.keywords.values())])
        self.jobs = [f"{one.name} {words}" for one in loggers]
        for place, one in enumerate(loggers):
            yield Outcome(place, one.name != "c", "")


def asked_of_many(desk: Desk, states: str, what: str) -> tuple[str, list[str]]:
    """What is said in the end, and what was asked of whom."""
    finder = Asked()
    begun(many.Many(desk, lambda: finder), states, what)
    return desk.does(), finder.jobs


def begun(asking: many.Many, states: str, what: str) -> None:
    """Begin it for loggers a, b, c in these states; `x` is silent."""
    lines = []
    for name, letter in zip("abc", states, strict=False):
        state, saved = STATES.get(letter, (State.RUNNING, True))
        told = Summary(state=state, ticks=400, saved=saved)
        member = Member(LoggerAddress(name, 0, "", ""), told, letter != "x")
        lines.append(FoundLogger(name, 1, "ann", f"{name}.1", member))
    asking.begin(what, lines)


@pytest.mark.parametrize(
    ("states", "what", "answer", "offered", "jobs", "said"),
    [
        ("rR", "start_stop", "y", "Stop 2 loggers? () No (y) Stop 2 loggers (s) Stop and save 2 loggers",
         "a stopping, b stopping", "stop: 2 did, 0 did not, 0 waiting"),
        ("r", "start_stop", "s", "Stop 1 logger? () No (y) Stop 1 logger (s) Stop and save 1 logger",
         "a stopping_and_saving", "stop: 1 did, 0 did not, 0 waiting"),
        ("ss", "start_stop", "y", "Start 2 loggers? () No (y) Start 2 loggers",
         "a starting refuse, b starting refuse", "start: 2 did, 0 did not, 0 waiting"),
        ("us", "start_stop", "s",
         "Start 2 loggers? () No (s) Save what isn't, and start 2 loggers (D) Drop what isn't saved: start 2 loggers!",
         "a starting save, b starting save", "start: 2 did, 0 did not, 0 waiting"),
        ("u", "start_stop", "D",
         "Start 1 logger? () No (s) Save what isn't, and start 1 logger (D) Drop what isn't saved: start 1 logger!",
         "a starting discard", "start: 1 did, 0 did not, 0 waiting"),
        ("rss", "start_stop", "t", "Start or stop 3 loggers? () No (y) Stop 1 logger (s) Stop and save 1 logger "
         "(t) Start 2 loggers", "b starting refuse, c starting refuse", "start: 1 did, 1 did not, 0 waiting"),
        ("rus", "start_stop", "v", "Start or stop 3 loggers? () No (y) Stop 1 logger (s) Stop and save 1 logger "
         "(v) Save what isn't, and start 2 loggers (D) Drop what isn't saved: start 2 loggers!",
         "b starting save, c starting save", "start: 1 did, 1 did not, 0 waiting"),
        ("rx", "start_stop", "y", "Stop 1 logger? () No (y) Stop 1 logger (s) Stop and save 1 logger",
         "a stopping", "stop: 1 did, 0 did not, 0 waiting"),
        ("r", "start_stop", ESC, "Stop 1 logger? () No (y) Stop 1 logger (s) Stop and save 1 logger", "", ""),
        ("Rs", "restart", "y", "Restart 2 loggers? () No (y) Restart 2 loggers",
         "a restarting refuse, b restarting refuse", "restart: 2 did, 0 did not, 0 waiting"),
        ("Rr", "restart", "s", "Restart 2 loggers? () No (s) Save, and restart 2 loggers "
         "(D) Drop what isn't saved: restart 2 loggers!",
         "a restarting save, b restarting save", "restart: 2 did, 0 did not, 0 waiting"),
        ("r", "restart", ESC, "Restart 1 logger? () No (s) Save, and restart 1 logger "
         "(D) Drop what isn't saved: restart 1 logger!", "", ""),
        ("r", "save", "y", "Save 1 logger? () No (y) Save as .silo, each in its own folder "
         "(a) Save as silo, csv and bag", f"a saving {[FileType.SILO]}", "save: 1 did, 0 did not, 0 waiting"),
        ("r", "save", "a", "Save 1 logger? () No (y) Save as .silo, each in its own folder "
         "(a) Save as silo, csv and bag", f"a saving {[FileType.SILO, FileType.CSV, FileType.BAG]}",
         "save: 1 did, 0 did not, 0 waiting"),
        ("r", "load", "quiet", "Load a script into 1 logger", "a loading quiet.yaml",
         "load: 1 did, 0 did not, 0 waiting"),
        ("r", "load", "quiet.yml", "Load a script into 1 logger", "a loading quiet.yml",
         "load: 1 did, 0 did not, 0 waiting"),
        ("r", "load", "", "Load a script into 1 logger", "", ""),
    ],
)  # fmt: skip
def test_of_many_loggers_each_is_asked_what_the_answer_says(states, what, answer, offered, jobs, said, fake):
    desk = Desk(fake, answer)
    told, asked = asked_of_many(desk, states, what)
    assert (told, ", ".join(asked)) == (said, jobs)
    title, *body = desk.asked[0].split("\n")
    assert " ".join([title, *(line for line in body if line.startswith("("))]) == offered
    assert (": left alone" in desk.asked[0]) is ("x" in states)


def test_of_loggers_that_are_all_silent_nothing_is_asked(fake):
    desk = Desk(fake)
    assert asked_of_many(desk, "xx", "save") == ("none of them is there: ^l looks again", [])


def test_one_that_never_answered_holds_up_no_other_command(fake, monkeypatch):
    desk = Desk(fake, "y")
    asking = many.Many(desk, Asked)
    with monkeypatch.context() as patch:
        patch.setattr(Asked, "ask_many", lambda *_: iter(()))
        begun(asking, "r", "start_stop")
        assert desk.does() == ""
    desk.answers = ["y"]
    begun(asking, "r", "save")
    assert desk.does() == "save: 1 did, 0 did not, 0 waiting"


def test_many_loggers_are_asked_one_thing_at_a_time(fake):
    desk = Desk(fake)
    asking = many.Many(desk, Asked)
    asking._verb, asking._counts = "stop", [1, 0, 2]
    asking.begin("save", [])
    assert desk.said == ["stop: 2 have not answered yet"]


def test_what_is_restored_leaves_edits_of_elements_that_are_not_there_and_says_so(saved):
    desk = Desk(saved)
    of_none = [kept.KeptEdit(f"/log/nothing{each}", Field.DIVIDER, 1, 5) for each in range(2)]
    desk.session.lent.gone_edits = [kept.KeptEdit(NAME, Field.DIVIDER, 1, 5), *of_none]
    left = "2 edits left out: of elements that are not there; :restore again once they are"
    assert desk.does(flows.restore(desk)) == (f"1 edit pending again: a applies; {left}; e w keeps it in the script")
    assert desk.session.lent.gone_edits == of_none
    assert desk.does(flows.restore(desk)) == left


def test_who_starts_a_logger_that_somebody_else_just_started_is_told_who_was_first(saved):
    desk = Desk(saved)
    saved.state = State.RUNNING  # of which no news came yet
    saved.happen("started", "started", saved.now_ns, who="bob@desk silo-tui 7")
    assert desk.does(flows.start_stop(desk)) == (
        f"somebody was faster: it was started already, by bob@desk at {wall_clock(saved.now_ns)}"
    )
    assert desk.session.running
