"""Endless recordings in the terminal: begun, watched, ended."""

import asyncio

import msgspec
import pytest
from msgspec import structs

from silo.core.elements import RecorderState
from silo.errors import RefusedError
from silo.recorder.requests import RecorderInfo
from silo.recordings.requests import Recordings
from silo_tui.actions import BY_ID
from silo_tui.keymap import counts
from silo_tui.model.lists.recorders import WritingPace, head, head_words, row

SECOND = 10**9
NOW_NS = 1_790_000_100 * SECOND
WALK = RecorderInfo(
    "walk", "/home/ann/logs/walks", RecorderState.RECORDING, ["legs/*/*/torque"], 10**9, 0.0, 50 * 10**9, "walk_3.mcap",
    20, 21 * 10**9, 1000, 0, NOW_NS - 9067 * SECOND, written_bytes=30 * 10**9,
)  # fmt: skip
FULL = RecorderInfo(
    "imu", "/home/ann/logs/walks", RecorderState.FAILED, [], parts=12, lost=3, since_ns=NOW_NS, text="1.9 GB disk left"
)


class TestRows:
    @pytest.mark.parametrize("width", [80, 120, 160])
    def test_a_recorder_is_a_line_as_wide_as_its_head(self, robot, width):
        names = [each.name for each in robot]
        line = row(WALK, names, WritingPace(0.0, 0, 2.3e6), "/home/ann/logs", width, NOW_NS)
        assert line.split()[:6] == ["REC", "walks/walk", "12", "2:31:07", "2.3", "MB/s"]
        assert "██▏   21 of 50 GB" in line
        assert line.endswith("   21     0")
        assert len(line) == len(head(width)) == width

    @pytest.mark.parametrize(
        ("size", "keep", "shown"),
        [(45_300_000, 10**9, "  45 MB of 1 GB"), (400_000_000, 2 * 10**9, "0.4 of 2 GB"), (70, 0, " 30 GB"),
         (54_000, 100_000_000, " 54 kB of 100 MB"), (123_000, 1_250_000_000, " 120 kB of 1.25 GB")],
    )  # fmt: skip
    def test_what_is_written_shows_in_a_large_budget_and_without_one_only_its_own(self, robot, size, keep, shown):
        one = structs.replace(WALK, size_bytes=size, keep_bytes=keep)
        line = row(one, [each.name for each in robot], None, "/home/ann/logs", 80, NOW_NS)
        assert shown in line
        assert f" {head_words([one])} " in line
        assert len(line) == 80

    def test_one_that_ended_by_itself_tells_why(self, robot):
        line = row(FULL, [each.name for each in robot], None, "/home/ann/logs", 80, NOW_NS)
        assert "STOP" in line
        assert "1.9 GB disk left" in line
        assert len(line) == 80

    def test_a_rate_is_known_after_the_second_look(self):
        first = WritingPace(10.0, 1000)
        assert first.next(10.1, 2000) is first
        assert first.next(14.0, 9000).bytes_s == 2000.0


slow = pytest.mark.slow  # each walks through the whole app


@slow
class TestScreens:
    async def test_what_runs_stands_above_what_is_saved(self, fake, opened, monkeypatch):
        fake.recorder_infos = [WALK, FULL]
        async with opened(fake) as screen:
            await screen.shows("REC 1")
            asked, listed = screen.session.refresh_recorders, asyncio.Event()

            async def refresh():
                await listed.wait()
                await asked()

            monkeypatch.setattr(screen.session, "refresh_recorders", refresh)
            await screen.do("recordings", shows="Nothing is saved")
            listed.set()
            await screen.shows("walks/walk")
            await screen.shows("1.9 GB disk left")
            await screen.shows("t ends one that runs")

    async def test_the_head_of_the_table_follows_how_much_a_recording_holds(self, fake, opened, monkeypatch):
        monkeypatch.setattr("silo_tui.sessions.live.RECORDERS_S", 0.0)
        fake.recorder_infos = [WALK, FULL]
        async with opened(fake) as screen:
            await screen.shows("REC 1  21 of 50 GB")
            fake.recorder_infos = [structs.replace(WALK, size_bytes=22 * 10**9), FULL]
            await screen.shows("REC 1  22 of 50 GB")

    async def test_what_is_marked_is_recorded_with_split_and_budget(self, fake, screen):
        await screen.type("/LF torque")
        await screen.do("enter", "asterisk", "escape", "recordings", shows="Nothing is saved")
        await screen.do("record", shows="3 signals: about 31.2 kB/s in .mcap files")
        await screen.press("tab")
        await screen.type("walks")
        await screen.press("tab", "tab", "tab")
        await screen.type("all")
        assert screen.app.screen.made().keep == ""
        await screen.press(*["backspace"] * 3)
        await screen.type("200MB", shows="a part ends at 100 MB, half of it")
        await screen.press(*["backspace"] * 5)
        await screen.type("2GB", shows="keeps about the newest 17.8 h")
        assert "a part ends" not in screen.text
        await screen.press("enter", shows="recording 'robot' to /home/ann/logs/walks")
        names = tuple(f"/log/legs/LF/{joint}/torque" for joint in ("HAA", "HFE", "KFE"))
        assert ("record", names, "walks", "1GB", "2GB", "") in fake.calls
        await screen.shows("walks/robot")
        await screen.shows("REC 1")

    @pytest.mark.parametrize("size", [(80, 24), (160, 50)])
    async def test_what_is_recorded_for_a_while_alone_is_said_with_what_to_do(self, size, fake, opened):
        fake.record_warns = (
            "25 elements are recorded only until their buffers are full (/base/inertia, /base/mass, /base/name, "
            "/legs/LF/HAA/peak_torque, /legs/LF/HAA/serial_number, ...), or, where it grows, until there is no memory; "
            "buffer=looping or action=both has them recorded without end"
        )
        async with opened(fake.run(), size=size) as screen:
            await screen.enter("/imu")
            await screen.enter(":record")
            await screen.press("enter", shows="recording 'robot' to /home/ann/logs/recordings; 25 elements")
            told = " ".join(screen.text.split())
            assert "25 elements are recorded only until their buffers are full" in told
            assert "; buffer=looping or action=both has them recorded without end" in told

    @pytest.mark.parametrize("steps", [("recordings", "record"), (":", *"record", "enter")])
    async def test_what_a_budget_deletes_of_an_earlier_recording_is_said_before_it_is_begun(
        self, fake, opened, monkeypatch, steps
    ):
        found = Recordings("/home/ann/logs", [], 0, recorded={"recordings/robot": 6_750_000, "recordings/arm": 5})
        monkeypatch.setattr(fake, "recordings", lambda most=1000: found)
        async with opened(fake) as screen:
            await screen.do(*steps)
            await screen.press("tab", "tab", "tab", "tab")
            await screen.type("8MB", shows="6.75 MB of earlier recordings 'robot' go first")
            await screen.press("tab", "tab", "tab")
            await screen.type("second")
            await screen.until(lambda: "go first" not in screen.text)

    async def test_what_makes_no_sense_is_said_where_one_types_and_nothing_is_recorded(self, fake, screen):
        await screen.do("recordings", shows="Nothing is saved")
        await screen.do("stop_recording", shows="nothing is being recorded; N begins it")
        await screen.do("record", shows="72 signals")
        for name in ("signals", "to", "name"):  # the field that has the keys is seen without colours
            await screen.shows(f">{name} ")
            assert screen.text.count("│ >") + screen.text.count(" >name") == 1
            await screen.press("tab")
        await screen.type("x", shows="split must be a size from 1MB or a time")
        await screen.press("enter", shows="split must be")
        await screen.press("escape")
        await screen.until(lambda: not screen.app.screen.is_modal)
        await screen.enter(":record nobody", shows="no element matches 'nobody'")
        await screen.press("escape")
        await screen.until(lambda: not screen.app.screen.is_modal)
        await screen.enter(":record marked")
        await screen.shows("nothing is marked: mark elements in the table, or write all, or names")
        assert not fake.recorder_infos

    async def test_what_was_typed_stands_in_the_lines_again_where_it_is_refused(self, fake, opened, monkeypatch):
        def refused(*given):
            raise RefusedError("the folder is outside of the logger's")

        async with opened(fake) as screen:
            monkeypatch.setattr(fake, "record", refused)
            await screen.do("recordings", "record", shows="72 signals")
            await screen.press("tab")
            await screen.enter("/tmp", shows="the folder is outside of the logger's")
            monkeypatch.undo()
            assert screen.app.screen.fields["to"] == "/tmp"
            await screen.press(*["backspace"] * 4)
            await screen.enter("walks", shows="recording 'robot' to /home/ann/logs/walks")

    async def test_one_is_stopped_after_a_question(self, fake, opened):
        fake.recorder_infos = [WALK, FULL]
        async with opened(fake) as screen:
            await screen.do("recordings", shows="walks/walk")
            await screen.do("stop_recording", shows="Stop which recording of robot?")
            await screen.press("enter")
            await screen.until(lambda: screen.app.screen is screen.app.context.upper_screen)
            assert fake.recorder_infos == [WALK, FULL]
            await screen.do("stop_recording", shows="Stop recording 'walk': 21 parts written")
            await screen.shows("those that are kept stay")
            await screen.press("1", shows="recording 'walk' ended")
            assert fake.recorder_infos == [FULL]
            await screen.until(lambda: "REC " not in screen.text.splitlines()[0])
            await screen.do("stop_recording", shows="Stop recording 'imu' of robot?")
            await screen.press("d", shows="d is no answer here  Enter Leave it")
            await screen.press("y")  # of one that is asked for, as anywhere
            await screen.until(lambda: fake.recorder_infos == [])

    async def test_how_much_is_recorded_moves_in_the_question_as_well(self, fake, opened):
        fake.recorder_infos = [WALK, FULL]
        async with opened(fake) as screen:
            await screen.enter(":endrecording", shows="Stop recording 'walk': 21 parts written")
            await screen.press("j")
            fake.recorder_infos = [msgspec.structs.replace(WALK, parts=WALK.parts + 3, lost=7), FULL]
            await screen.shows("Stop recording 'walk': 24 parts written")
            await screen.press("enter")
            await screen.until(lambda: fake.recorder_infos == [FULL])

    async def test_one_is_stopped_where_it_was_begun(self, fake, opened):
        fake.recorder_infos = [WALK]
        async with opened(fake) as screen:
            assert counts(BY_ID["stop_recording"], "table")  # by the letters of the menu
            await screen.enter(":endrecording", shows="Stop recording 'walk' of robot?")
            await screen.press("y")
            await screen.until(lambda: fake.recorder_infos == [])

    async def test_the_list_follows_the_parts_that_are_finished(self, fake, opened, monkeypatch):
        fake.recorder_infos, told = [WALK], fake.recordings
        asked = []
        monkeypatch.setattr(fake, "recordings", lambda most=200: asked.append(most) or told(most))
        async with opened(fake) as screen:
            await screen.do("recordings", shows="walks/walk")
            await screen.until(lambda: screen.app.screen._parts is not None)
            before = len(asked)
            fake.recorder_infos = [structs.replace(WALK, parts=WALK.parts + 1)]
            await screen.until(lambda: len(asked) > before, "the list anew")

    async def test_a_read_only_session_records_nothing(self, screen, read_only=True):
        await screen.do("recordings", shows="Nothing is saved")
        await screen.do("record", shows="Record: this is read-only")
