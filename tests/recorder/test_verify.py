"""`silo verify`: what is missing, twice, damaged or disagrees in a folder of recordings, captures, logs and events."""

import itertools
import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

import silo
from silo.cli.main import run
from silo.conditions.captures.files import write_capture
from silo.conditions.segment_judge import SegmentJudge
from silo.core.elements import LoggedEvent
from silo.core.quantities.writing import count, many
from silo.files.event_log import append_events, event_log_path
from silo.files.manifest import CaptureEntry, CaptureList, read_captures
from silo.files.mcap.chunks import records
from silo.files.mcap.writer import MAGIC
from silo.recorder.orders import RecordOrder
from silo.segment.held_runs import hold, make_stub
from silo.segment.reader import SegmentReader
from silo.verify.folder import verify
from silo.verify.gone import captures_that_lack


class Kept:
    """A folder with a run that was recorded by hand, and its event log."""

    def __init__(self, robot, truth, folder: Path) -> None:
        self.robot, self.truth, self.folder = robot, truth, folder
        self.numbers = itertools.count(1)

    def begin(self):
        self.robot.start()
        self.run = self.robot.log._present.run.id
        self.happens("started", "started", 0)
        return self.recorder()

    def recorder(self):
        return self.truth.direct(self.robot, RecordOrder("bot", str(self.folder / "rec")))

    def happens(self, kind: str, text: str, tick: int) -> None:
        number = next(self.numbers)
        event = LoggedEvent(
            kind, text, 2_000_000_000_000_000_000 + 1000 * number + tick, tick, 0, "bot", self.run, number
        )
        append_events(self.folder, "bot", [event])

    def recorded(self, ticks: int, *, stopped: bool = True) -> None:
        """Record so many ticks, all of them."""
        direct = self.begin()
        direct.ticks(ticks)
        direct.finish()
        self.robot.log.close()
        if stopped:
            self.happens("stopped", "stopped", ticks - 1)

    @property
    def part(self) -> Path:
        (path,) = (self.folder / "rec").glob("*.mcap")
        return path

    def found(self):
        """Kind and ticks of each problem, and of each that was told."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = verify(self.folder)
        return [[(one.kind, one.spans) for one in some] for some in (found.problems, found.told)]


def counted(folder):
    """Of each run: ticks, how many of them are recorded, saved, captured, in memory; and the ticks that are nowhere."""
    found = verify(folder)
    rows = [(one.ticks, one.recorded, one.saved, one.captured, one.in_memory) for one in found.runs]
    return rows, [one.spans for one in found.not_kept]


@pytest.fixture
def kept(robot, truth, tmp_path):
    return Kept(robot, truth, tmp_path)


def test_a_folder_in_which_all_is_there_once_is_whole(kept, capsys):
    kept.recorded(300)
    assert kept.found() == [[], []]
    assert run(["verify", str(kept.folder)]) == 0
    assert "1 run: whole" in capsys.readouterr().out
    assert counted(kept.folder) == ([(300, 300, 0, 0, 0)], [])


def test_ticks_that_were_collected_after_the_last_part_are_missing(kept, capsys):
    kept.recorded(300, stopped=False)
    kept.happens("stopped", "stopped", 339)
    assert kept.found() == [[("missing", ((300, 339),))], []]
    assert run(["verify", "--json", str(kept.folder)]) == 4
    (problem,) = json.loads(capsys.readouterr().out)["problems"]
    assert "40 ticks (300-339) of run" in problem["text"]


@pytest.mark.parametrize("rows", [True, False])
def test_what_is_held_of_a_run_until_its_recorder_has_it_is_not_missing(kept, rows):
    direct = kept.begin()
    kept.robot.ticks(300)
    direct.step()
    direct.finish()
    kept.robot.ticks(40)
    held = hold(Path(kept.robot.log._present.path))
    kept.robot.log.close()
    if not rows:
        make_stub(held)
    kept.happens("stopped", "stopped", 339)
    assert kept.found() == [[] if rows else [("missing", ((300, 339),))], []]
    assert counted(kept.folder)[0] == [(340, 300, 0, 0, 340 if rows else 0)]


LAST_40, DISAGREES = ("missing", ((300, 339),)), ("disagrees", ())
WHOLE = "the logger was closed, or its program ended"
FULL = "the disk is nearly full; the end of 1 run is in no file; 1 file, 960 samples, 0 lost, and the end of a run"


@pytest.mark.parametrize(
    ("kind", "words", "at", "last", "problems", "told"),
    [
        ("recording", ": its recorder died; 40 ticks are lost", 339, 339, [], [LAST_40]),
        ("recording failed", f" ended: {FULL}", 339, 339, [], [LAST_40]),
        ("recording", " goes on; 0 lost", 339, 339, [LAST_40], []),  # that is no word of a loss
        ("recording", f" ended: {WHOLE}", 339, 339, [LAST_40], []),
        ("recording", f" ended: {WHOLE}; 1 file, 960 samples, 0 lost", 339, 339, [LAST_40, DISAGREES], []),
        ("recording", " ended; 1 file, 5 samples, 0 lost", 299, 299, [DISAGREES], []),
        ("recording", " ended: 1 file, 960 samples, 0 lost", 299, 999, [], []),  # somebody ended it before the run
    ],
)  # fmt: skip
def test_what_is_told_of_a_recording_is_held_against_its_parts(kept, kind, words, at, last, problems, told):
    kept.recorded(300, stopped=False)  # 960 samples: x, q and word, and each fifth tick slow
    kept.happens(kind, f"recording 'bot'{words}", at)
    kept.happens("stopped", "stopped", last)
    assert kept.found() == [problems, told]


def test_a_hole_between_two_parts_is_missing(kept, tmp_path, truth):
    robot = kept.robot = truth.robot(tmp_path / "small", size=50)
    direct = kept.begin()
    direct.ticks(40)
    direct.finish()
    robot.ticks(500)
    direct = kept.recorder()
    direct.ticks(10)
    direct.finish()
    robot.log.close()
    kept.happens("stopped", "stopped", 549)
    ((kind, ((first, last),)),) = kept.found()[0]
    assert (kind, first) == ("missing", 40)
    assert 490 < last < 540


@pytest.mark.parametrize("recorded_before", [0, 1])
def test_a_run_that_began_after_its_recording_was_ordered_is_to_be_there_from_its_first_tick(kept, recorded_before):
    kept.run = "before"
    kept.happens("recording", f"recording 'bot' of all elements to {kept.folder}/rec", 0)
    for _ in range(recorded_before):
        kept.recorded(30)
        kept.robot = kept.truth.robot(kept.folder)
    kept.robot.start()
    kept.run = kept.robot.log._present.run.id
    kept.happens("started", "started", 0)
    kept.robot.ticks(40)
    direct = kept.recorder()
    direct.ticks(60)
    direct.finish()
    kept.robot.log.close()
    kept.happens("stopped", "stopped", 99)
    assert kept.found()[0] == [("missing", ((0, 39),))]


def test_a_run_between_two_that_were_recorded_is_missing_as_a_whole(kept):
    kept.recorded(100)
    between = "c0ffee"
    event = LoggedEvent("started", "started", 2_100_000_000_000_000_000, 0, 0, "bot", between, 50)
    append_events(kept.folder, "bot", [event, LoggedEvent("stopped", "stopped", event.time_ns, 77, 0, "", between, 51)])
    kept.robot = kept.truth.robot(kept.folder)
    kept.recorded(60)
    event = LoggedEvent("started", "started", 2_200_000_000_000_000_000, 0, 0, "bot", kept.run, 60)
    append_events(kept.folder, "bot", [event])
    assert ("missing", ((0, 77),)) in kept.found()[0]


def test_a_last_run_of_which_a_recording_that_was_under_way_has_nothing_is_missing_as_a_whole(kept):
    kept.run = "before"
    kept.happens("recording", f"recording 'bot' of all elements to {kept.folder / 'rec'}", 0)
    kept.recorded(300)
    kept.run = "the last one"
    kept.happens("started", "started", 0)
    kept.happens("edited", "something happens", 99)
    assert kept.found() == [[], []]  # it goes on
    kept.happens("stopped", "stopped", 119)
    assert kept.found() == [[("missing", ((0, 119),))], []]
    kept.happens(
        "recording",
        "recording 'bot' ended: the logger was closed, or its program ended; 1 file, 1 sample, 0 lost",
        119,
    )
    assert ("missing", ((0, 119),)) in kept.found()[0]


def test_a_last_run_in_which_somebody_ended_its_recording_or_that_is_recorded_elsewhere_lacks_nothing(kept, tmp_path):
    kept.run = "before"
    kept.happens("recording", f"recording 'bot' of all elements to {kept.folder / 'rec'}", 0)
    kept.happens("recording", f"recording 'far' of all elements to /{tmp_path.name}/else", 0)
    kept.recorded(300)
    kept.run = "the last one"
    kept.happens("started", "started", 0)
    kept.happens("recording", "recording 'bot' ended: stopped by ann; 1 file, 1800 samples, 0 lost", 2)
    kept.happens("stopped", "stopped", 119)
    assert [kind for kind, _ in kept.found()[0]] != ["missing"]


def test_ticks_while_a_recording_was_stopped_are_no_loss_and_told_as_not_recorded(kept, capsys):
    direct = kept.begin()
    kept.happens("recording", f"recording 'bot' of * to {kept.folder}/rec", -1)
    direct.ticks(40)
    direct.finish()
    kept.happens("recording", "recording 'bot' ended: stopped by ann; 1 file, 129 samples, 0 lost", 42)
    kept.robot.ticks(103)
    direct = kept.recorder()
    kept.robot.ticks(57)
    kept.happens("recording", f"recording 'bot' of * to {kept.folder}/rec", 150)
    direct.step()
    direct.finish()
    kept.robot.log.close()
    kept.happens("stopped", "stopped", 199)
    assert kept.found() == [[], []]
    assert run(["verify", str(kept.folder)]) == 0
    shown = capsys.readouterr().out
    assert f"not recorded: recording 'bot': 103 ticks (40-142) of run {kept.run}, of 200 ticks, were not" in shown
    assert "it was stopped then, and begun again (events 3 and 4)" in shown


def test_what_is_lost_at_the_end_of_a_recording_that_was_stopped_once_and_begun_again_is_missing(kept):
    direct = kept.begin()
    kept.happens("recording", f"recording 'bot' of * to {kept.folder}/rec", -1)
    kept.happens("recording", "recording 'bot' ended: stopped by ann; 0 files, 0 samples, 0 lost", 0)
    kept.happens("recording", f"recording 'bot' of * to {kept.folder}/rec", 0)
    direct.ticks(40)
    direct.finish()
    kept.robot.log.close()
    kept.happens("stopped", "stopped", 49)
    assert kept.found()[0] == [("missing", ((40, 49),))]


@pytest.mark.parametrize("told_late", [False, True])
def test_a_program_that_was_started_again_without_a_recording_lacks_nothing(kept, told_late):
    runs = []

    def told_ended(of: str) -> None:
        kept.run, present = of, kept.run
        text = "recording 'bot' ended: the logger was closed, or its program ended; 1 file, 300 samples, 0 lost"
        kept.happens("recording", text, 99)
        kept.run = present

    for recorded in (True, False, True):
        if recorded:
            direct = kept.begin()
            kept.happens("recording", f"recording 'bot' of * to {kept.folder}/rec", -1)
        else:
            kept.robot.start()
            kept.run = kept.robot.log._present.run.id
            kept.happens("started", "started", 0)
            if told_late:
                told_ended(runs[0])
        runs.append(kept.run)
        kept.robot.ticks(100)
        if recorded:
            direct.step()
            direct.finish()
        kept.robot.log.close()
        kept.happens("stopped", "stopped", 99)
        if recorded and not (told_late and len(runs) == 1):
            told_ended(kept.run)
        kept.robot = kept.truth.robot(kept.folder)
    assert [one for one in kept.found()[0] if one[0] == "missing"] == []
    assert counted(kept.folder)[1] == [((0, 99),)]


def test_a_run_that_ended_before_its_first_tick_lacks_none(kept):
    kept.run = "the only one"
    kept.happens("started", "started", 0)
    kept.happens("parameter", "1 parameter at the start", 0)
    kept.happens("recording", f"recording 'bot' of all elements to {kept.folder / 'rec'}", -1)
    kept.happens("crashed", "the robot program ended without close()", -1)
    assert kept.found() == [[], []]
    assert counted(kept.folder)[0] == [(0, 0, 0, 0, 0)]


@pytest.mark.parametrize(("lost", "text"), [(0, ""), (7, "7 samples were told to be lost (event 3), and of 0 alone")])
def test_samples_that_are_told_to_be_lost_at_the_end_are_held_against_where(kept, lost, text):
    kept.recorded(300)
    samples = 300 * 3 + 60  # x, q and word, and each fifth tick slow
    kept.happens("recording", f"recording 'bot' ended: stopped; 1 file, {samples} samples, {lost} lost", 299)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problems = verify(kept.folder).problems
    assert [one.kind for one in problems] == ["disagrees"] * bool(lost)
    assert all(text in one.text for one in problems)
    if lost:
        kept.happens("recording", f"recording 'bot': {lost} samples were lost, of ticks 3 to 4: the disk", 4)
        assert kept.found()[0] == []


def test_ticks_that_were_told_to_be_lost_behind_the_last_row_are_missing_and_nobody_took_them_away(kept):
    kept.recorded(300)
    samples = 300 * 3 + 60
    kept.happens("recording", "recording 'bot': 128 samples were lost, of ticks 300 to 339: their time stamps", 300)
    kept.happens("recording", f"recording 'bot' ended: stopped; 1 file, {samples} samples, 128 lost", 339)
    problems, told = kept.found()
    assert (problems, told) == ([], [("missing", ((300, 339),))])
    assert not [one for one in verify(kept.folder).not_kept if "no longer there" in one.text]


def test_a_parameter_that_was_set_behind_the_last_tick_makes_none(kept):
    kept.recorded(40)
    kept.happens("parameter", "x 0 -> 7", 40)  # holds from tick 40 on, which never came
    assert kept.found() == [[], []]
    assert counted(kept.folder)[0] == [(40, 40, 0, 0, 0)]


def test_ticks_behind_a_save_that_a_start_dropped_were_not_overwritten(kept):
    robot = kept.robot
    robot.start()
    kept.run = robot.log._present.run.id
    robot.ticks(60)
    robot.log.save()
    robot.ticks(20)
    kept.happens("stopped", "stopped", 79)
    robot.log.restart()
    found = verify(kept.folder)
    assert [one.ticks for one in found.runs] == [80, 0]
    assert [(one.spans, one.text.partition("recorded them: ")[2]) for one in found.not_kept] == [
        (((60, 79),), "its memory was let go of, and nobody had saved them; saved are 60 ticks (0-59)")
    ]


def test_a_ring_that_was_overwritten_is_not_called_whole(tmp_path, truth, capsys):
    robot = truth.robot(tmp_path, size=100)
    robot.start()
    robot.ticks(2500)
    assert run(["verify", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "of 2 500 ticks are in no file, and nothing recorded them: buffers keep the newest samples" in shown
    assert "in memory are " in shown
    assert "1 run: all is there that was to be kept" in shown
    assert ": whole" not in shown
    ((_, *_, held),), _ = counted(tmp_path)
    assert 500 <= held < 2500  # every fifth tick, and a ring has room for some more
    assert counted(tmp_path) == ([(2500, 0, 0, 0, held)], [((0, 2499 - held),)])
    robot.log.save()
    assert counted(tmp_path) == ([(2500, 0, 500, 0, held)], [((0, 2499 - held),)])
    robot.log.close()
    assert run(["verify", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "2 000 ticks (0-1999) of 2 500 ticks are in no file" in shown
    assert "saved are 500 ticks (2000-2499)" in shown
    assert ": whole" not in shown


def test_a_looping_buffer_that_is_shorter_by_its_own_option_was_to_keep_the_newest(tmp_path, truth, capsys):
    robot = truth.robot(tmp_path, size=2000)
    late = robot.log.array("late", (), size=40)
    robot.start()
    late[...] = 1
    robot.ticks(500)
    robot.log.save()
    robot.log.close()
    found = verify(tmp_path)
    assert counted(tmp_path) == ([(500, 0, 500, 0, 0)], [])
    assert [(one.kind, one.spans) for one in found.newest] == [("newest", ((0, 459),))]
    assert run(["verify", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert ": looping buffers hold the newest only: /log/late the last 40 ticks\n1 run: whole\n" in shown
    assert "in no file" not in shown


def test_what_a_looping_buffer_holds_is_counted_from_its_first_sample_on(tmp_path, truth):
    robot = truth.robot(tmp_path, size=2000)
    late = robot.log.array("late", (), size=8, divider=5)
    robot.start()
    late[...] = 1
    robot.ticks(500)
    robot.log.save()
    robot.log.close()
    (found,) = verify(tmp_path).newest
    (element,) = [one for one in silo.open_log(tmp_path).recording.elements if one.name == "/log/late"]
    assert element.count * 5 == 500 - element.stamp_indices[0]
    assert found.text.endswith(f": looping buffers hold the newest only: /log/late the last {element.count * 5} ticks")


def test_buffers_that_differ_as_sizes_are_rounded_up_are_not_told(tmp_path, truth):
    robot = truth.robot(tmp_path, size=100)
    robot.log.update()
    robot.log.set("slow", size=20)
    robot.log.array("seventh", (), divider=7, size=15)
    robot.start()
    robot.ticks(500)
    robot.log.save()
    robot.log.close()
    assert verify(tmp_path).newest == ()


@pytest.mark.parametrize("by_hand", [False, True])
def test_ticks_that_a_recording_had_and_its_budget_deleted_are_told_as_such(kept, capsys, by_hand):
    order = RecordOrder("bot", str(kept.folder / "rec"), keep_bytes=0 if by_hand else 60_000, split_bytes=20_000)
    kept.robot.start()
    kept.run = kept.robot.log._present.run.id
    kept.happens("started", "started", 0)
    direct = kept.truth.direct(kept.robot, order)
    for _ in range(20):
        direct.ticks(100)
    direct.finish()
    kept.robot.log.close()
    kept.happens("stopped", "stopped", 1999)
    if by_hand:
        for path in sorted((kept.folder / "rec").glob("*.mcap"))[:-1]:
            path.unlink()
    ((_, recorded, *_),), ((gone,),) = counted(kept.folder)
    assert gone == (0, 1999 - recorded)
    assert kept.found() == [[], []]
    assert run(["verify", str(kept.folder)]) == 0
    shown = capsys.readouterr().out
    why = "its parts that did are no longer there" if by_hand else "its budget deleted them"
    assert f"of 2 000 ticks are in no file: recording 'bot' had them, and {why}" in shown
    assert "nothing recorded them" not in shown


def test_ticks_that_stand_in_two_parts_are_told(kept):
    kept.recorded(300)
    shutil.copy(kept.part, kept.part.with_name("bot_20260101_00-00-00_00099.mcap"))
    assert kept.found() == [[("twice", ((0, 299),))], []]


def test_a_part_that_is_damaged_from_its_begin_is_told(kept):
    kept.recorded(300)
    kept.part.with_name("bot_20260101_00-00-00_00099.mcap").write_bytes(b"nothing of ours")
    assert kept.found() == [[("damaged", ())], []]


@pytest.mark.parametrize("lacking", [1, 100, 4000])
def test_a_finished_part_whose_end_is_missing_is_told_with_what_helps(kept, lacking, capsys):
    kept.recorded(300)
    whole = kept.part.read_bytes()
    kept.part.write_bytes(whole[:-lacking])
    assert run(["verify", str(kept.folder)]) == 4
    words = "the file is cut off: its end is missing, as of a copy that was interrupted"
    assert f"damaged: rec/{kept.part.name}: {words}" in capsys.readouterr().out
    with pytest.warns(silo.LogWarning, match=words):
        silo.open_log(kept.part)
    left = kept.part.with_name("left.mcap.part")
    left.write_bytes(whole[:-lacking])
    with pytest.warns(silo.LogWarning, match="the file is not finished: .*`silo recover` closes it"):
        silo.open_log(left)


@pytest.mark.parametrize("which", [0, -1])
def test_times_that_flipped_in_the_index_of_a_part_are_told_and_read_off_its_messages(kept, capsys, which):
    kept.recorded(300)
    path, data = kept.part, bytearray(kept.part.read_bytes())
    before = silo.open_log(path, check=True)
    assert before.warnings == ()
    chunks = [place for opcode, place, _ in records(data, len(MAGIC)) if opcode == Opcode.CHUNK]
    index = chunks[which] + 9 + int.from_bytes(data[chunks[which] + 1 : chunks[which] + 9], "little")
    data[index + 9 + 6 + 2] ^= 4  # of its first time
    path.write_bytes(data)
    assert run(["verify", str(kept.folder)]) == 4
    words = f"of the chunk at byte {chunks[which]:,} the index is damaged: its times, or where it points, are not those"
    assert f"damaged: rec/{path.name}: {words}" in capsys.readouterr().out
    with pytest.warns(silo.LogWarning, match="the index is damaged: its times"):
        after = silo.open_log(path, check=True)
    assert after.time_ns.tolist() == before.time_ns.tolist()
    assert all(after[name].values.tolist() == before[name].values.tolist() for name in before)


@pytest.mark.parametrize(("kind", "harm"), [("bag", "cut"), ("bag", "flip"), ("bag", ""), ("csv", "cut"), ("csv", "")])
def test_a_saved_bag_or_table_that_is_damaged_is_told_as_damage(tmp_path, truth, capsys, kind, harm):
    robot = truth.robot(tmp_path)
    robot.start()
    robot.ticks(50)
    robot.log.mark("here")
    (saved,) = robot.log.save(kind)
    robot.log.close()
    path = next(Path(saved.path).glob("*.mcap")) if kind == "bag" else Path(saved.path)
    data = bytearray(path.read_bytes())
    if harm == "flip":
        chunk = next(place for opcode, place, _ in records(data, len(MAGIC)) if opcode == Opcode.CHUNK)
        data[chunk + 120] ^= 1
    path.write_bytes(data[: len(data) * 2 // 3] if harm == "cut" else data)
    assert run(["verify", str(tmp_path)]) == (4 if harm else 0)
    assert (f"damaged: {Path(saved.path).name}: " in capsys.readouterr().out) == bool(harm)


@pytest.mark.parametrize("kind", ["bag", "csv", "silo"])
def test_what_a_saved_log_tells_of_its_run_is_no_damage(tmp_path, new_logger, kind):
    stamps = iter([0, 0, *range(0, 200, 10), *range(50, 250, 10)])
    log = new_logger(clock=lambda: next(stamps) * 1_000_000, folder=tmp_path)
    kept, few = log.array("kept"), log.array("few", size=5, buffer=silo.BufferType.FIXED)
    log.add(np.zeros(2), "let_go")
    log.start()
    for _ in range(30):
        kept += 1
        few += 1
        log.collect()
    log.save(kind)
    log.close()
    with pytest.warns(silo.LogWarning, match="stepped back"):
        assert "nobody but silo holds this array" in str(silo.open_log(tmp_path).warnings)
    assert run(["verify", str(tmp_path)]) == 0


def test_values_of_a_saved_log_that_are_damaged_are_told_as_damage(tmp_path, truth, capsys):
    robot = truth.robot(tmp_path)
    robot.start()
    robot.ticks(50)
    (saved,) = robot.log.save()
    robot.log.close()
    assert run(["verify", str(tmp_path)]) == 0
    path = Path(saved.path)
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    assert run(["verify", str(tmp_path)]) == 4
    shown = capsys.readouterr().out
    assert f"damaged: {path.name}: values of '/log/word' are damaged" in shown
    path.write_bytes(data[:-1])
    assert [one.kind for one in verify(tmp_path).problems] == ["damaged"]


def _had_no_room(lost):
    names = ", ".join(f"{count(samples)} of {name}" for name, samples in lost.items())
    return f"{many(sum(lost.values()), 'sample')} had no room in a buffer: {names}"


def test_samples_that_growing_buffers_had_no_room_for_are_missing(tmp_path, capsys):
    log = silo.Logger(
        "bot", frequency=1000, folder=tmp_path, script=tmp_path / "no.yaml", memory_limit_mb=5, max_time=0
    )
    log.array("x", buffer="growing", size=1000)
    log.array("v", 200, buffer="growing", size=1000)
    log.start()
    for _ in range(4000):
        log.collect()
    log.stop()
    lost = {name: log[name].lost for name in ("/log/x", "/log/v")}
    assert sum(lost.values()) > 1000
    assert [one.text.partition(": ")[2] for one in verify(tmp_path).problems] == [_had_no_room(lost)]
    log.save("silo", name="a")
    log.save("csv", name="b")
    log.close()
    words = _had_no_room(lost)
    assert run(["verify", str(tmp_path)]) == 4
    assert f", of 4 000 ticks: {words}" in capsys.readouterr().out
    recording, told = silo.open_log(tmp_path / "a.silo").recording, "184 samples could not be kept"
    texts = {"started": "started", "lost": told}
    events = [
        LoggedEvent(kind, text, recording.started_ns, at, 0, "bot", recording.run, at)
        for at, (kind, text) in enumerate(texts.items())
    ]
    append_events(tmp_path, "bot", events)
    assert run(["verify", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert f"{words}; event 1: {told}" in shown
    assert "1 run: not whole, 1 told before" in shown


def test_saved_files_that_are_gone_are_named_unless_somebody_told_to_have_deleted_them(kept, tmp_path):
    path = tmp_path / "bot_20260309_10-00-00_00008.silo"
    kept.recorded(300)
    kept.happens("saved", f"saved {path} (13.3 kB), {path.with_suffix('.parquet')} (1 MB), {tmp_path}/csv (0 B)", 299)
    kept.happens("saved", "saved /nowhere/else/is.silo (3 B)", 299)
    shutil.copy(kept.part, path.with_suffix(".parquet"))
    assert verify(tmp_path).problems == (), "a format is there, and what was saved elsewhere is not looked for"
    path.with_suffix(".parquet").unlink()
    there = [one.text for one in verify(tmp_path).problems]
    assert there[0] == f"{path.name}, {path.stem}.parquet, csv was saved (event 3), and is gone"
    kept.happens("deleted", f"deleted {path.name}, is.silo (13.3 kB)", 299)
    found = verify(tmp_path)
    assert (len(found.problems), [one.told[:7] for one in found.told]) == (0, ["event 5"])


def test_a_part_of_a_cut_run_that_is_gone_is_named(tmp_path):
    log = silo.Logger("bot", frequency=100, folder=tmp_path, script=tmp_path / "none.yaml")
    log.array("x", buffer="growing")
    log.start()
    for tick in range(60):
        if tick in (20, 40):
            log.set("x", divider=3 - log["x"].options.divider, cut=True)
        log.collect()
    log.save()
    log.close()
    assert verify(tmp_path).problems == ()
    (gone,) = tmp_path.glob("*_part2.silo")
    gone.unlink()
    assert [one.text.partition(" was ")[2] for one in verify(tmp_path).problems] == ["cut, and lacks part 2"]


def test_ticks_that_a_memory_may_have_which_can_not_be_seen_are_not_called_overwritten(tmp_path):
    log = silo.Logger("bot", frequency=1000, folder=tmp_path, script=tmp_path / "none.yaml", max_time=0)
    log.array("x", buffer="looping", size=3000)
    log.start()
    for _ in range(200):
        log.collect()
    recording = silo.open_log(log.save("silo", name="a").path).recording
    run, started_ns = recording.run, recording.started_ns
    log.close()
    events = [LoggedEvent("started", "started", started_ns, 0, 0, "bot", run, 1)]
    append_events(tmp_path, "bot", [*events, LoggedEvent("mark", "here", started_ns + 1, 999, 0, "bot", run, 2)])
    (told,) = verify(tmp_path).not_kept
    assert told.spans == ((200, 999),)
    assert "no memory of it can be seen from here" in told.text
    append_events(tmp_path, "bot", [LoggedEvent("stopped", "stopped", started_ns + 2, 999, 0, "bot", run, 3)])
    (told,) = verify(tmp_path).not_kept
    assert "can be seen" not in told.text


@pytest.mark.parametrize(
    ("written", "problems", "told"),
    [
        (lambda first, second: [first, second, first], [("twice", ())], []),
        (lambda first, second: [first, second, b"{}\n"], [], [("damaged", ())]),
        (lambda _, second: [second.replace(b"2000000000000002299", b"1"), second], [("missing", ())], []),
    ],
    ids=["twice", "damaged", "without the start of the run"],
)
def test_what_is_wrong_with_the_lines_of_an_event_log_is_told(kept, written, problems, told):
    kept.recorded(300)
    path = event_log_path(kept.folder, "bot")
    path.write_bytes(b"".join(written(*path.read_bytes().splitlines(keepends=True))))
    assert kept.found() == [problems, told]


def test_where_nothing_of_silo_is_that_is_said(tmp_path, capsys):
    assert run(["verify", str(tmp_path)]) == 1
    assert "there are no logs, no recordings and no event log in it" in capsys.readouterr().err


class TestCaptures:
    @pytest.fixture
    def spiked(self, tmp_path, runtime_folder):
        """A logger with one capture of a fire at tick 300, whose event says so."""
        log = silo.Logger("bot", frequency=1000, max_time=0, folder=tmp_path, script=tmp_path / "none.yaml")
        x = log.array("x", (), size=3000)
        log.trigger("spike", "x > 50", pre="20ms", post="10ms")
        log.start()
        for tick in range(500):
            x[...] = 100.0 if tick == 300 else 0.0
            log.collect()
        reader = SegmentReader(log._present.path)
        (buffer,) = SegmentJudge(reader, log.elements).step().whole
        self.run = reader.schema.run
        self.events = [
            LoggedEvent("started", "started", reader.schema.started_ns, 0, run=self.run, number=1),
            LoggedEvent("triggered", "trigger 'spike' fired at tick 300", 2, 300, run=self.run, number=2),
            LoggedEvent("stopped", "stopped", 3, 499, run=self.run, number=3),
        ]
        append_events(tmp_path, "bot", self.events)
        happened = [event for event in self.events if event.kind == "triggered"]
        self.files = write_capture(buffer, str(tmp_path), CaptureList(str(tmp_path), "bot"), happened).files
        log.close()
        return tmp_path

    def found(self, folder):
        found = verify(folder)
        return [[(one.kind, one.spans) for one in some] for some in (found.problems, found.told)]

    def test_a_fire_that_is_captured_is_whole(self, spiked):
        assert self.found(spiked) == [[], []]
        assert counted(spiked) == ([(500, 0, 0, 31, 0)], [((0, 499),)])

    def test_a_fire_without_its_capture_is_missing(self, spiked):
        Path(self.files[0].path).unlink()
        assert self.found(spiked) == [[("missing", ()), ("missing", ((300, 300),))], []]

    def test_a_capture_that_was_told_and_is_gone_is_missing_unless_newer_ones_had_it_go(self, spiked):
        path = Path(self.files[0].path)
        text = "capture 1 of 'spike', ticks 280 to 310: gone.silo"
        append_events(spiked, "bot", [LoggedEvent("captured", text, 4, 300, run=self.run, number=4)])
        path.rename(spiked / "later.silo")
        (problem,) = verify(spiked).problems
        assert problem.text == f"{path.name} is gone: it was capture 1 of 'spike' in run {self.run}"
        (spiked / "kept").mkdir()
        (spiked / "later.silo").rename(spiked / "kept" / path.name)
        assert self.found(spiked) == [[], []], "it was put into a folder below"
        (spiked / "kept" / path.name).unlink()
        (spiked / "2.silo").write_bytes(b"")
        CaptureList(str(spiked), "bot").written(CaptureEntry(self.run, "spike", 2, "2"), [str(spiked / "2.silo")], 1)
        assert [one for one in verify(spiked).problems if one.kind == "missing"] == []

    def test_a_capture_that_made_room_is_no_problem_though_its_trigger_keeps_more_by_now(self, tmp_path):
        listed = CaptureList(str(tmp_path), "bot")
        for number, keep in ((1, 5), (2, 1), (3, 5)):
            path = tmp_path / f"{number}.silo"
            path.touch()
            listed.written(CaptureEntry("run", "spike", number, str(number)), [str(path)], keep)
        there = frozenset(path.name for path in tmp_path.iterdir())
        assert "1.silo" not in there
        keeps = {("bot", "spike"): 5}
        assert list(captures_that_lack(there, "bot", read_captures(tmp_path, "bot"), keeps)) == []
        (gone,) = captures_that_lack(there - {"2.silo"}, "bot", read_captures(tmp_path, "bot"), keeps)
        assert gone.text == "2.silo is gone: it was capture 2 of 'spike' in run run"

    def test_a_fire_whose_capture_was_told_to_be_lost_is_told_apart(self, spiked):
        Path(self.files[0].path).unlink()
        text = "capture 1 of 'spike', ticks 280 to 310, is lost: the helper process died"
        append_events(spiked, "bot", [LoggedEvent("blind", text, 4, 300, run=self.run, number=4)])
        assert self.found(spiked) == [[("missing", ())], [("missing", ((300, 300),))]]

    def test_one_fire_in_two_captures_is_told(self, spiked):
        path = Path(self.files[0].path)
        shutil.copy(path, path.with_name("bot_20260101_00-00-00_00099_spike_1.silo"))
        assert self.found(spiked) == [[("twice", ((300, 300),))], []]

    def test_a_fire_that_is_told_twice_is_told(self, spiked):
        event = LoggedEvent("triggered", "trigger 'spike' fired at tick 300", 9, 300, run=self.run, number=9)
        append_events(spiked, "bot", [event])
        assert self.found(spiked) == [[("twice", ((300, 300),))], []]

    def test_a_capture_that_was_begun_only_is_missing(self, spiked):
        CaptureList(str(spiked), "bot").note(CaptureEntry(self.run, "spike", 2, "name"))
        assert self.found(spiked) == [[("missing", ())], []]


def test_what_was_saved_to_another_folder_is_in_a_file(kept, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    robot = kept.robot
    robot.start()
    kept.run = robot.log._present.run.id
    robot.ticks(80)
    path = Path(robot.log.save(folder=elsewhere).path)
    kept.happens("saved", f"saved {path} (13 kB)", 79)
    kept.happens("stopped", "stopped", 79)
    robot.log.close()
    assert counted(kept.folder) == ([(80, 0, 80, 0, 0)], [])
    path.unlink()
    ((verdict,), rows) = verify(kept.folder).not_kept, counted(kept.folder)[0]
    assert rows == [(80, 0, 0, 0, 0)]
    assert verdict.text.endswith(
        f"they may be in what was saved to another folder, and can't be read there: {path} (event 1)"
    )


def test_fires_without_a_capture_are_told_in_one_line_for_each_trigger(kept):
    kept.recorded(300, stopped=False)
    for tick in range(100, 300, 10):
        kept.happens("triggered", f"trigger 'hit' fired at tick {tick}", tick)
    kept.happens("stopped", "stopped", 299)
    (missing,) = verify(kept.folder).problems
    assert (missing.kind, len(missing.spans)) == ("missing", 20)
    assert "trigger 'hit' fired 20 times in run" in missing.text
    assert missing.text.endswith("at ticks 100, 110, 120, 130, 140 and 15 more")


def test_captures_that_were_never_written_are_told_in_one_line_for_each_trigger(kept):
    kept.recorded(300)
    for number in range(1, 9):
        CaptureList(str(kept.folder), "bot").note(CaptureEntry(kept.run, "hit", number, f"name{number}"))
    (missing,) = verify(kept.folder).problems
    assert missing.text == f"captures 1, 2, 3, 4, 5 and 3 more of 'hit' in run {kept.run} were begun and never written"
