"""What dialogs say, without an app: changes and their cost, differences of scripts, endless recordings."""

import asyncio
import math
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from silo.core.elements import Action, BufferType, FieldChange, RecorderState, State
from silo.errors import SiloError
from silo.recorder.requests import RecorderInfo
from silo.recordings.requests import Recordings
from silo.scripts.requests import ScriptDiff, Scripts
from silo_tui.model.lists.runs import COMPARED, ORDERS
from silo_tui.model.table.changes import Cost
from silo_tui.model.table.state import PendingChange
from silo_tui.screens.dialogs import recorder
from silo_tui.screens.dialogs.form import Form
from silo_tui.screens.dialogs.questions import (
    LARGEST,
    MAX_GROUPS,
    MAX_LINES,
    Choice,
    OrderDialog,
    Question,
    cost_text,
    diff_text,
    groups_text,
)
from silo_tui.screens.dialogs.recorder import RecordDialog, Wish
from silo_tui.screens.dialogs.scripts import AS_BEGUN, script_diff_text, scripts_question
from silo_tui.screens.files.save_data import SaveDialog
from tests.stand_ins.desk import ESC, Desk, Straight
from tests.stand_ins.fake_signals import scalar

HEAT, GAIT, PLACE = "/log/imu/temperature", "/log/state/gait", "/log/base/position"


# ------------------------------------------------------------------------------------------------------------- changes


def changes(count: int, theirs: str | None = None) -> list[PendingChange]:
    """So many, each of a kind of its own."""
    return [PendingChange(f"/log/a{at}", "divider", "1", str(at + 2), theirs) for at in range(count)]


def test_equal_changes_stand_together_below_the_prefix():
    found = [FieldChange(f"/log/{leg}/torque", "divider", "1", "5") for leg in "abcde"]
    found.append(FieldChange(HEAT, "size", "100", "200"))
    assert groups_text(found, "/log").plain == "5 × /*/torque  divider 1 → 5\n1 × /imu/temperature  size 100 → 200\n"
    assert groups_text([]).plain == ""


@pytest.mark.parametrize(("count", "more"), [(MAX_GROUPS, ""), (MAX_GROUPS + 1, "and 1 more\n")])
def test_of_many_kinds_of_changes_the_rest_is_counted(count, more):
    words = diff_text(changes(count), "/log").plain
    assert words.count(" × ") == MAX_GROUPS
    assert words.removesuffix(more).endswith("\n")
    assert ("more" in words) is bool(more)


@pytest.mark.parametrize(("count", "rest"), [(LARGEST, 0), (LARGEST + 1, 0), (LARGEST + 2, 2), (LARGEST + 5, 5)])
def test_what_all_costs_stands_behind_the_largest_groups(count, rest):
    words = diff_text(changes(count), "/log", cost_text(NOW, NOW, "")).plain
    assert words.count(" × ") == count
    before = words.partition("memory")[0]
    assert before.count(" × ") == (LARGEST if rest else count)
    assert (f"and {rest} more, behind what all of it costs:\n" in before) is bool(rest)


def test_what_somebody_else_changed_meanwhile_stands_at_the_end_as_far_as_it_has_room():
    words = diff_text(changes(MAX_LINES + 1, "7"), "/log").plain
    assert words.count("\n! /a") == MAX_LINES
    assert "! /a0: divider is 7 now, by somebody else\n" in words
    assert "!" not in diff_text(changes(2)).plain


NOW = Cost(1e6, 8e3, 4e3, 10.0, 10.0, HEAT)


@pytest.mark.parametrize(
    ("after", "room", "lines"),
    [
        ({}, 0, ["memory 1 MB 1 MB", "recorded 8 kB/s 8 kB/s while recording all", "topics 4 kB/s 4 kB/s",
                 "held 10 s 10 s the shortest: t"]),
        ({"memory_bytes": 2e6}, 0, ["memory 1 MB 2 MB ▲"]),
        ({"memory_bytes": 2e6}, 3_000_000, ["memory 1 MB 2 MB ▲ of 3 MB available"]),
        ({"memory_bytes": 2e6}, 2_000_000, ["memory 1 MB 2 MB ▲ of 2 MB available"]),
        ({"memory_bytes": 4e6}, 3_000_000, ["memory 1 MB 4 MB !! of 3 MB available"]),
        ({"memory_bytes": 5e5}, 3_000_000, ["memory 1 MB 500 kB of 3 MB available"]),
        ({"memory_bytes": 1e6 + 1}, 0, ["memory 1 MB 1 MB"]),  # it reads the same
        ({"recorded_bytes_s": 9e3, "topic_bytes_s": 5e3}, 0,
         ["recorded 8 kB/s 9 kB/s ▲ while recording all", "topics 4 kB/s 5 kB/s ▲"]),
        ({"recorded_bytes_s": 7e3}, 0, ["recorded 8 kB/s 7 kB/s while recording all"]),
        ({"shortest_s": 5.0}, 0, ["held 10 s 5 … 10 s ▼ the shortest: t"]),
        ({"shortest_s": 50.0, "longest_s": 7200.0}, 0, ["held 10 s 50 s … 2 h the shortest: t"]),
        ({"shortest_s": math.inf, "longest_s": math.inf}, 0, ["held 10 s all until memory is full"]),
        ({"longest_s": math.inf}, 0, ["held 10 s 10 s … all the shortest: t"]),
        ({"shortest": ""}, 0, ["held 10 s nothing the shortest: t"]),
    ],
)  # fmt: skip
def test_what_a_table_costs_has_a_sign_at_what_gets_worse(after, room, lines):
    found = [" ".join(line.split()) for line in cost_text(NOW, replace(NOW, **after), "t", room).plain.split("\n")]
    assert set(lines) <= set(found), found


# ------------------------------------------------------------------------------------------------------------- scripts


@pytest.mark.parametrize(
    ("diff", "words"),
    [
        (ScriptDiff("a", [], []), "It would change nothing.\n"),
        (ScriptDiff("a", [FieldChange("/x", "divider", "1", "2"), FieldChange("/x", "size", "3", "4")], []),
         "It would change 1 element:\n1 × /x  divider 1 → 2, size 3 → 4\n"),
        (ScriptDiff("a", [], [], [], [FieldChange("trigger fall", "pre", "1 s", "2 s")]),
         "Beside elements it would change:\ntrigger fall\n  pre 1 s → 2 s\n"),
        (ScriptDiff("a", [FieldChange("/x", "divider", "1", "2")], [], [],
                    [FieldChange("trigger fall", "", "none", "x > 1"), FieldChange("limits of y", "", "H 3", "none")]),
         "It would change 1 element:\n1 × /x  divider 1 → 2\n\nBeside elements it would change:\n"
         "trigger fall\n  new: x > 1\nlimits of y\n  taken away: H 3\n"),
        (ScriptDiff("a", [], [], ["a:3: no such key"]), "It would change nothing.\n\na:3: no such key\n"),
        (ScriptDiff("a", [], ["/u", "/v"]),
         "It would change nothing.\n\nNames that the logger doesn't have (they are left out): /u, /v"),
    ],
)  # fmt: skip
def test_what_a_script_would_change_is_told(diff, words):
    assert script_diff_text(diff).plain == words


def test_a_script_tells_names_as_the_table_does():
    words = script_diff_text(ScriptDiff("a", [FieldChange("/log/x", "divider", "1", "2")], ["/log/u"]), "/log").plain
    assert "1 × /x  divider 1 → 2" in words
    assert words.endswith("(they are left out): /u")


@pytest.mark.parametrize(("count", "more"), [(20, "/u19"), (21, "/u19 and 1 more")])
def test_of_many_unknown_names_the_first_are_told(count, more):
    assert script_diff_text(ScriptDiff("a", [], [f"/u{at}" for at in range(count)])).plain.endswith(more)


def test_a_script_that_can_t_be_read_says_why_in_its_place(fake):
    asked = scripts_question(Straight(fake), Scripts("/config", ["quiet.yaml", "robot.yaml"], "/config/robot.yaml"))  # type: ignore[arg-type]
    assert [one.label for one in asked._choices] == ["quiet.yaml", "robot.yaml  (current)"]
    assert asked._choices[asked._begin].value == "robot.yaml"
    assert str(asked._body) == "in /config, on the robot: Enter loads one; below, what it would change"
    assert "It would change 1 element" in asyncio.run(asked._about("quiet.yaml")).plain
    assert asyncio.run(asked._about("gone.yaml")).plain.startswith("It can't be loaded:\nthere is no script")
    asked = scripts_question(Straight(fake), Scripts("/config", ["quiet.yaml"], ""), "", "/log", ["/log/x", "/log/y"])  # type: ignore[arg-type]
    assert [one.label for one in asked._choices] == ["as the program began", "quiet.yaml"]
    told = asyncio.run(asked._about(AS_BEGUN)).plain
    assert told.split("\n") == ["It would take back what became of 2 elements since:", "/x", "/y"]


def test_where_there_are_no_scripts_it_is_told_how_one_is_made(fake):
    asked = scripts_question(Straight(fake), Scripts("/config", [], ""))  # type: ignore[arg-type]
    assert str(asked._body) == "in /config, on the robot: none yet; e w saves the present settings as one"
    assert asked._about is None


# --------------------------------------------------------------------------------------------------- endless recordings


def recording(name: str, **more: Any) -> RecorderInfo:
    told = {"part": "part2.mcap", "parts": 1, "size_bytes": 10**6, "written_bytes": 10**6, "lost": 0, **more}
    return RecorderInfo(name, "/logs", RecorderState.RECORDING, **told)


STAY = "Its last part is finished, all its parts stay where they are."
KEPT = "Its last part is finished, those that are kept stay where they are."


@pytest.mark.parametrize(
    ("infos", "answer", "asked", "said"),
    [
        ([recording("all")], "y", f"{STAY}\n() Keep recording\n(y) Stop recording 'all': 2 parts, 1 MB, lost 0",
         "recording 'all' ended: 1 files"),
        ([recording("all")], ESC, f"{STAY}\n() Keep recording\n(y) Stop recording 'all': 2 parts, 1 MB, lost 0", ""),
        ([recording("a", part="", lost=1200), recording("b")], "2",
         f"{STAY}\n() Keep recording\n(1) Stop recording 'a': 1 part, 1 MB, lost 1 200\n"
         "(2) Stop recording 'b': 2 parts, 1 MB, lost 0",
         "recording 'b' ended: 1 files"),
        ([recording("a", written_bytes=10**7)], ESC,
         f"{KEPT}\n() Keep recording\n(y) Stop recording 'a': 2 parts written, the newest 1 MB kept, lost 0", ""),
        ([recording("a", keep_bytes=5 * 10**7)], ESC,
         f"{KEPT}\n() Keep recording\n(y) Stop recording 'a': 2 parts, 1 MB so far, lost 0", ""),
        ([msgspec.structs.replace(recording("a"), state=RecorderState.FAILED)], "y",
         f"{STAY}\n() Leave it\n(y) Take recording 'a' off the list: 2 parts, 1 MB, lost 0",
         "recording 'a' ended: 1 files"),
    ],
)  # fmt: skip
def test_which_recording_is_to_end_is_asked_with_how_each_stands(infos, answer, asked, said, fake):
    fake.recorder_infos = infos
    desk = Desk(fake, answer)
    assert desk.does(recorder.end(desk, desk.session)) == said
    title = "Stop which recording of robot?" if len(infos) > 1 else f"Stop recording '{infos[0].name}' of robot?"
    assert desk.asked == [f"{title}\n{asked}"]
    assert (desk.done == "stop_recorder") is bool(said)
    assert len(desk.session.recorders) == len(infos) - bool(said)


def test_where_nothing_is_recorded_nothing_is_asked(fake):
    desk = Desk(fake)
    assert desk.does(recorder.end(desk, desk.session)) == "nothing is being recorded; r r begins it"


FIRST = {"signals": "all", "to": "", "name": "", "split": "1GB", "keep": ""}


class Lines(RecordDialog):
    """The lines that begin a recording, as they are typed."""

    def __init__(self, desk: Desk, free_bytes: int = 0, **typed: str) -> None:
        recorded = {"walks/robot": 6_750_000}
        self._session = desk.session
        self._found = Recordings("/logs", [], 0, free_bytes=free_bytes, recorded=recorded)
        self.typed = {**FIRST, **typed}

    fields = property(lambda self: self.typed)


def looked(desk: Desk, free_bytes: int = 0, **typed: str) -> str:
    return asyncio.run(Lines(desk, free_bytes, **typed).look())


@pytest.fixture
def desk(new_fake):
    return Desk(new_fake([scalar("/log/a/x"), scalar("/log/a/y"), scalar("/log/b/z", enabled=False)]))


@pytest.mark.parametrize(
    ("typed", "patterns"),
    [
        ({}, ()), ({"signals": ""}, ()), ({"signals": "a/* b/z"}, ("a/*", "b/z")),
        ({"signals": "marked"}, ("/log/a/y",)), ({"signals": "marked b/z"}, ("/log/a/y", "b/z")),
    ],
)  # fmt: skip
def test_signals_to_record_are_typed_as_patterns_or_words(typed, patterns, desk):
    desk.session.rows.marked[1] = True
    wish = Lines(desk, keep="all", **typed).made()
    assert wish == Wish(typed.get("signals", "all"), patterns, "", "1GB", "", "")


@pytest.mark.parametrize(
    ("typed", "why"),
    [
        ({"signals": "nothing/*"}, "no element matches 'nothing/\\*'"), ({"signals": "marked"}, "nothing is marked"),
        ({"split": "much"}, "much"), ({"keep": "much"}, "much"),
    ],
)  # fmt: skip
def test_what_can_t_be_recorded_is_refused(typed, why, desk):
    with pytest.raises((ValueError, SiloError), match=why):
        Lines(desk, **typed).made()


@pytest.mark.parametrize(
    ("free_bytes", "typed", "words"),
    [
        (0, {}, "3 signals, 1 of them off: about {rate}/s in .mcap files"),
        (0, {"signals": "a/*"}, "2 signals: about {rate}/s in .mcap files"),
        (0, {"signals": "b/z"}, "1 signal, 1 of them off: about 0 B/s in .mcap files"),
        (10**9, {"signals": "b/z"}, "1 signal, 1 of them off: about 0 B/s in .mcap files"),
        (10**9, {}, "3 signals, 1 of them off: about {rate}/s in .mcap files\n"
         "the disk takes {day} of it, then it stops by itself"),
        (10**9, {"keep": "4GB"}, "3 signals, 1 of them off: about {rate}/s in .mcap files\n"
         "keeps about the newest {kept}, then the "
         "oldest parts of its name go"),
        (10**9, {"keep": "1GB"}, "3 signals, 1 of them off: about {rate}/s in .mcap files\n"
         "keeps about the newest {day}, then the "
         "oldest parts of its name go\na part ends at 500 MB, half of it"),
        (0, {"keep": "4GB", "to": "walks", "name": "robot"}, "3 signals, 1 of them off: about {rate}/s in .mcap files\n"
         "keeps about "
         "the newest {kept}, then the oldest parts of its name go\n6.75 MB of earlier recordings 'robot' go first: "
         "another name keeps them"),
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    ("measured_hz", "rate", "day", "kept"),
    [(0.0, "20.8 kB", "13.4 h", "2.23 days"), (200.0, "10.4 kB", "26.7 h", "4.45 days")],
)
def test_how_fast_files_grow_and_for_how_long_there_is_room_is_told(
    measured_hz, rate, day, kept, free_bytes, typed, words, desk
):
    desk.session.status = msgspec.structs.replace(desk.session.status, state=State.RUNNING)
    desk.session.measured_hz = measured_hz
    said = looked(desk, free_bytes, **typed)
    assert said == words.format(rate=rate, day=day, kept=kept), said


@pytest.mark.parametrize(
    ("options", "ticks", "words"),
    [
        ({"size": 20_000}, 40_000, "2 signals: about 10.4 kB/s in .mcap files\n"
         "1 signal has its fixed buffer full: 0 samples; e b makes it loop"),
        ({"size": 20_001}, 40_000, "2 signals: about 15.6 kB/s in .mcap files"),
    ],
)  # fmt: skip
def test_of_a_full_fixed_buffer_it_is_told_before_that_nothing_is_recorded(options, ticks, words, new_fake):
    fixed = {"buffer": BufferType.FIXED, "action": Action.SAVE, "divider": 2, **options}
    desk = Desk(new_fake([scalar("/log/x"), scalar("/log/y", **fixed)]))
    desk.session.status = msgspec.structs.replace(desk.session.status, state=State.RUNNING)
    desk.session.ticks = ticks
    assert looked(desk) == words


def test_a_recording_is_begun_with_what_is_marked_else_with_all(desk, monkeypatch):
    begun: list[Any] = []

    async def taken(_: Any, form: Any, send: Any) -> None:
        begun.append(form(None, "")._values["signals"])
        await send(Wish("a/*", ("a/*",), "to", "1GB", "", "mine"))

    monkeypatch.setattr(recorder, "taken", taken)
    said = desk.does(recorder.begin(desk, desk.session))
    assert said == "recording 'mine' to /home/ann/logs/to"
    assert desk.fake.calls == [("record", ("a/*",), "to", "1GB", "", "mine")]
    assert [one.name for one in desk.session.recorders] == ["mine"]
    desk.session.rows.marked[1] = True
    record = desk.fake.record
    desk.fake.record = lambda *given: msgspec.structs.replace(record(*given), text="b/z is off")
    assert desk.does(recorder.begin(desk, desk.session)) == "recording 'mine' to /home/ann/logs/to; b/z is off"
    desk.does(recorder.begin(desk, desk.session, 0, "imu/*"))
    assert begun == ["all", "marked", "imu/*"]


# -------------------------------------------------------------------------------------------------------------- orders


def test_orders_whose_words_fit_beside_one_another_stand_in_two_columns_others_below_one_another():
    lines = OrderDialog(COMPARED, "largest", "↑")._lines().plain.splitlines()
    assert [line.rstrip() for line in lines[: len(COMPARED)]] == [
        "d the most different first: by the rms, for how far it moves",
        "n name",
        "a the largest difference first  ↑",
        "f how much of it differs, the most first",
    ]
    assert OrderDialog(ORDERS, "name", "↓")._lines().plain.splitlines()[:2] == [
        "b begun, the newest first       s span, the longest first       ",
        "n name  ↓                       l lost, the most first          ",
    ]


@pytest.mark.parametrize(
    ("failed", "words", "style"), [(True, "no room", "failed"), (False, "no room", "quiet"), (True, "2 files", "quiet")]
)
def test_a_save_that_failed_stands_as_such_however_often_it_is_said(monkeypatch, failed, words, style):
    told = []
    monkeypatch.setattr(Form, "tell", lambda _, words, style="": told.append((words, style)))
    dialog = SaveDialog.__new__(SaveDialog)
    dialog._result("no room", failed=failed)
    dialog.tell(words, "quiet")
    assert told == [("no room", "failed" if failed else ""), (words, style)]


def test_what_enter_does_stands_in_the_bar_from_the_first_moment_on():
    choices = [Choice("", "Keep recording"), Choice("a", "Stop a: 2 parts", "y")]
    assert Question("Stop?", "", choices).KEYS_HERE.startswith("Enter Keep recording  ")
    assert Question("Stop?", "", choices, begin="a").KEYS_HERE.startswith("Enter Stop a  ")
