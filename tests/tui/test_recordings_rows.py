"""The list of recordings as rows of text: names, dates, widths, filter."""

from datetime import datetime

import pytest

from silo.core.elements import FileType, LoggedEvent
from silo.recordings.requests import RecordingFile, SavedRecording
from silo_tui.model.lists import recordings as rows
from silo_tui.model.lists.ordering import arranged, passes
from silo_tui.model.words import text

BEGIN = 1_790_000_000 * 10**9
STEM = "robot_20260921_14-00-00_00007"


def one(stem=STEM, why="", **more):
    return SavedRecording(stem, [RecordingFile(f"{stem}.silo", FileType.SILO, 1000, BEGIN)], why=why, **more)


def test_a_name_is_shortened_only_where_it_must_be():
    assert rows.short_stem(STEM, "robot", len(STEM)) == "robot_20260921_14-00-00_00007"
    assert rows.short_stem(STEM, "robot", 12) == "…00007"
    assert rows.short_stem("first_walk", "robot", 12) == "first_walk"
    assert rows.short_stem(STEM, "arm", 13) == "robot…00007"
    assert rows.short_stem(f"{STEM}_fall_6.silo", "robot", 22) == "…00007_fall_6.silo"


def test_of_one_save_the_silo_file_is_opened_then_the_bag():
    files = [RecordingFile(kind.name, kind, 1000, BEGIN) for kind in (FileType.CSV, FileType.BAG, FileType.SILO)]
    assert rows.best_file(SavedRecording(STEM, files)).type is FileType.SILO
    assert rows.best_file(SavedRecording(STEM, files[:2])).type is FileType.BAG


def test_of_the_runs_of_one_robot_the_number_and_the_trigger_are_read_at_80_columns():
    found = [f"demo_20261129_03-1{at}-50_0000{at}_heavy_{at}.silo" for at in range(1, 8)]
    told = rows.fitting_stems(found, "demo", 22)
    assert list(told.values()) == [f"…0000{at}_heavy_{at}.silo" for at in range(1, 8)]
    several = rows.fitting_stems([*found, "arm_20261129_03-11-50_00001.silo"], "", 26)
    assert several[found[0]] == "demo…00001_heavy_1.silo"


@pytest.mark.parametrize(
    ("why", "name", "told"),
    [
        ("trigger hip_command", "…00009_hip_command_1", "trigger"),
        ("trigger fall", "…00009_hip_command_1", "trigger fall"),
        ("saved by the robot program", "…00009_hip_command_1", "by the program"),
        ("recording by ann@lab", "…00009…command_1", "recording by ann@lab"),
    ],
)  # fmt: skip
def test_a_name_has_the_room_that_no_reason_needs(why, name, told):
    found = [one("robot_20260921_14-00-00_00009_hip_command_1", why)]
    room = rows.why_room(found, {}, 80)
    (fits,) = rows.fitting_stems([found[0].stem], "robot", rows.name_room(80, room)).values()
    assert fits == name
    row = rows.row(found[0], fits, 80, 0.0, why=room)
    assert row[rows.head(80, room).index("why") - 2 :].startswith(f"{told} ")


def test_recordings_that_differ_never_look_alike():
    days = [one(f"robot_2026092{day}_14-00-00_00007") for day in (1, 2)]
    found = [*days, one("a_walk_over_rough_ground"), one("a_walk_over_rough_grass")]
    for width in (80, 120):
        assert len(set(rows.fitting_stems([each.stem for each in found], "robot", rows.name_room(width)).values())) == 4


def test_ten_times_as_many_recordings_are_compared_ten_times_as_often(monkeypatch):
    class Counted(str):
        compared = 0
        __hash__ = str.__hash__

        def __eq__(self, other):
            Counted.compared += 1
            return str.__eq__(self, other)

    monkeypatch.setattr(rows, "short_stem", lambda stem, own, room: Counted(stem))
    monkeypatch.setattr(rows, "fitting_names", lambda names, room: names)
    rows.fitting_stems([f"run_{number}" for number in range(500)], "robot", 80)
    assert Counted.compared < 5000


def test_rows_have_the_width_of_the_screen_and_the_titles_stand_over_them():
    for width in (80, 100, 120, 160, 250):
        row, head = rows.row(one(why="trigger fall" * 9, span_s=5.0), "robot", width, 0.0), rows.head(width)
        assert len(row) <= width - 2
        assert head.index("begun") - 2 == row.index(text.day_and_time(BEGIN, 0.0))


def test_a_recording_of_an_own_clock_is_dated_by_its_file():
    assert rows.begun_ns(one(begun_ns=5)) == BEGIN
    assert rows.begun_ns(one(begun_ns=BEGIN + 7)) == BEGIN + 7


@pytest.mark.parametrize(
    ("told", "marks"),
    [
        ({"why": "recording demo"}, "M2"),  # of the four below those within
        ({"why": "recording demo", "span_s": 0.0}, "M"),
        ({"why": "saved", "markers": 1}, "M"),  # as its file says
        ({"why": "trigger fall"}, "T"),
    ],
)
def test_marks_stand_beside_what_they_lie_in(told, marks):
    places = [("marker", -1), ("marker", 0), ("marker", 2 * 10**9), ("stopped", 10**9), ("marker", 3 * 10**9)]
    events = [LoggedEvent(kind, "push", BEGIN, 1, BEGIN + at_ns) for kind, at_ns in places]
    (marked,) = rows.with_markers([one(**{"begun_ns": BEGIN, "span_s": 2.0, **told})], events)
    assert rows.marks_text(marked) == marks


def test_a_date_has_a_year_where_it_is_of_another_one():
    when = datetime.fromtimestamp(BEGIN / 1e9)
    assert text.day_and_time(BEGIN, BEGIN / 1e9 + 40 * 86400) == f"{when:%d %b %H:%M}"
    assert text.day_and_time(BEGIN, BEGIN / 1e9 + 366 * 86400) == f"{when:%Y-%m-%d}"


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"why": "saved by hand", "logger": "robot"}, "by hand"), ({"why": "by hand"}, "by hand"),
        ({"logger": ""}, "of another program"), ({"unread": True}, "not looked into yet"),
        ({"why": "by hand", "unfinished": True}, "not finished yet"),
    ],
)  # fmt: skip
def test_a_row_says_why_there_is_a_recording_or_whose_it_is(more, why):
    assert rows.row(one(**more), "robot", 160, 0.0).startswith(
        f"{'robot':<{rows.row(one(), 'robot', 160, 0.0).index('of another')}}{why} "
    )


def test_a_filter_takes_words_in_any_order_either_and_not():
    walk = one("robot_20260921_14-00-00_00007_fall_3", "trigger fall")
    for words, passing in {
        "": True, "fall": True, "SILO fall": True, "bag": False, "bag|silo": True, "-bag": True, "-fall": False,
        "fall -trigger": False, "-": False,
    }.items():  # fmt: skip
        assert passes(rows.told(walk), words) is passing, words


def test_a_span_has_three_digits():
    assert [text.span(s, 3) for s in (0.0123, 5.7612, 433.0, 40_000.0)] == ["12.3 ms", "5.76 s", "7.22 min", "11.1 h"]


def test_of_two_that_began_at_once_the_later_name_comes_first():
    found = arranged([one("a_1"), one("a_2")], rows.ORDERS[0], turned=False)
    assert [each.stem for each in found] == ["a_2", "a_1"]


def test_two_saves_of_one_part_of_a_run_are_told_apart():
    dated = "robot_20260921_14-00-00_"
    names = ("00001", "00002_part1", "00003_part2", "00004_fall_1", "00005_part2", "00006_part2", "00007_part1",
             "00008_part2", "00009_part3")  # fmt: skip
    found = [one(dated + name, "saved by op@desk") for name in names][::-1]  # the newest first, as they are told
    told = rows.saves_of_parts([*found, one("arm_20260921_14-00-00_00004_part2")])
    assert {stem.removeprefix(dated): (of.part, of.number, of.of) for stem, of in told.items()} == {
        "00003_part2": (2, 1, 3), "00005_part2": (2, 2, 3), "00006_part2": (2, 3, 3),
    }  # fmt: skip
    shown = rows.row(found[4], "…00005_part2", 80, BEGIN / 1e9, told[found[4].stem])
    assert "…00005_part2     2 of 3, by op@desk" in shown
    assert told[found[4].stem].words.startswith("save 2 of 3 of part 2 of one run")
