"""The recordings in the logger's folder on the robot: listed, opened in place, fetched, deleted."""

import asyncio
import time
from collections.abc import Coroutine, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace
from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from silo.core.quantities.writing import and_more, many, size_text
from silo.errors import SiloError
from silo.recordings.requests import Recordings, SavedRecording
from silo_tui.actions import key_of
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.lists import recorders
from silo_tui.model.lists import recordings as rows
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.model.words.paths import typed_path
from silo_tui.screens.dialogs import recorder
from silo_tui.screens.dialogs.questions import Prompt, ask_line, confirmed
from silo_tui.screens.files.opened import brought_here, open_recording, overlay_recording
from silo_tui.screens.lists.list_screen import ComparesTwo, LoggerList, Opener
from silo_tui.sessions.live import Session
from silo_tui.sessions.recordings import Fetching, GivenUpError, here
from silo_tui.theme import bold

FOLLOW_S = 0.25
FIRST, MOST = 200, 10_000  # how many are asked for
LOOK_AGAIN_S = 0.3


class RecordingsScreen(LoggerList[SavedRecording], ComparesTwo[SavedRecording]):
    """A list of what is saved; what is being recorded stands above it."""

    scope = "recordings"
    orders = rows.ORDERS
    filter_hint = "words of name, why and type; -not"

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.found: Recordings | None = None
        self._deleted_here: set[str] = set()
        self._most = FIRST
        self._asking = False  # for the older ones
        self._saves: dict[str, rows.PartSave] = {}
        self._why = rows.WHY  # cells of it
        self._parts: list[tuple[str, int]] | None = None  # that endless recordings have finished

    def above(self) -> ComposeResult:
        yield from self.bars()
        yield Static("", id="recordings-running", markup=False)

    def begin(self) -> None:
        """Ask at once; follow what is fetched."""
        self.read_again()
        self._look()
        self.set_interval(FOLLOW_S, self._follow_fetches)

    # ------------------------------------------------------------------------------------------------------- lines

    @property
    def all(self) -> Sequence[SavedRecording]:
        return self.found.recordings if self.found is not None else ()

    def key_of(self, one: SavedRecording) -> str:
        return one.stem

    def prepare(self, found: Sequence[SavedRecording], width: int) -> None:
        self._saves, own = rows.saves_of_parts(found), self.session.status.logger or self.session.name
        self._why = rows.why_room(found, self._saves, width)
        self._names = rows.fitting_stems([one.stem for one in found], own, rows.name_room(max(40, width), self._why))

    def row_of(self, one: SavedRecording, width: int) -> Text:
        of = self._saves.get(one.stem)
        words = Text("  " + rows.row(one, self._names[one.stem], max(40, width), time.time(), of, self._why))
        if one.unfinished or one.unread or not self.session.connected:
            words.stylize("dim")
        return words

    def told(self, one: SavedRecording) -> str:
        return rows.told(one)

    def follow(self, known: str, place: int | None) -> int | None:
        """Return it; the list begins with what a program that died left, which the banner has told of."""
        found, session = super().follow(known, place), self.session
        if known in self._deleted_here:
            self.marks.settle()
        if place is None and session.dead:
            told = " ".join([session.status.reason, *(file.path for file in session.left_files)])
            left = (at for at, one in enumerate(self.shown) if any(f"/{file.name}" in told for file in one.files))
            found = next(left, found)
        return found

    def head(self, width: int) -> str:
        return rows.head(max(40, width), self._why)

    def words(self) -> str:
        saved = rows.summary(self.found) if self.found is not None else ""
        runs = any(not one.state.over for one in self.session.recorders)
        ends = f"{key_of('stop_recording') or ':endrecording'} ends one that runs"
        of = self._saves.get(self.chosen_key)
        return " │ ".join(filter(None, [of.words if of is not None else "", saved, ends * runs]))

    def going_on(self) -> Sequence[str]:
        asking = ["asking for the older ones …"] if self._asking else []
        return [*asking, *super().going_on()]

    def none(self) -> str:
        if self.found is None:
            return f"Asking {self.session.name} …"
        return f"Nothing is saved in {self.found.folder} yet. {key_of('save_data')} in the table saves what is held."

    def may_be(self, one: SavedRecording) -> bool:
        return not one.unfinished

    # ---------------------------------------------------------------------------------------------------- data

    def read_again(self) -> None:
        """Ask what there is."""
        if self.is_running and self.app.is_running:
            run_alone(self, "recordings", self._read)

    async def _read(self) -> None:
        while True:
            try:
                found = await self.session.recordings(self._most)
            except SiloError as error:
                self._asking = False
                self.say(f"the list can't be read: {error}")
                return
            marked = rows.with_markers(found.recordings, self.session.happened)
            self.found = replace(found, recordings=marked)
            self._asking = False
            self.show()
            if not any(one.unread for one in found.recordings):
                break
            await asyncio.sleep(LOOK_AGAIN_S)  # what there was no time to look into

    def _look(self) -> None:
        """Ask how endless recordings stand."""
        if self.session.connected and self.context.upper_screen is self:
            run_alone(self, "recorders", self._look_at_recorders)

    async def _look_at_recorders(self) -> None:
        """Follow them, and the list where a part was finished since: an older one may be deleted for it."""
        before = self._parts
        await self.context.quietly(self.session.refresh_recorders())
        self._show_running()
        self.show_words()  # which name the key that ends one
        self._parts = [(one.name, one.parts) for one in self.session.recorders]
        if before is not None and before != self._parts:
            self.read_again()

    def _show_running(self) -> None:
        """Draw what is being recorded; nothing where nothing is."""
        for lines in self.query("#recordings-running").results(Static):  # none of a screen that is gone
            lines.display = bool(self.session.recorders)
            lines.update(Text("\n", no_wrap=True).join(self._running_lines()))

    def _running_lines(self) -> list[Text]:
        session, width = self.session, max(40, self.size.width)
        found = [Text(recorders.head(width), "dim", no_wrap=True)]
        for one in session.recorders:
            pace, folder = session.paces.get(one.name), session.status.folder
            row = recorders.row(one, session.table.names, pace, folder, width, time.time_ns(), session.recorders)
            line = Text(row, no_wrap=True, overflow="ellipsis")
            full = one.keep_bytes and one.size_bytes >= recorders.FULL_SHARE * one.keep_bytes
            caution = one.state in recorders.CAUTION or full or one.lost
            name = "alarm" if one.state in recorders.LOUD else "warning" if caution else "success"
            line.stylize(bold(self.app.theme_variables, name), 2, 6)
            found.append(line)
        return found

    def _follow_fetches(self) -> None:
        if self.session.fetches:
            self.show_words()

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        if self.context.upper_screen is self:
            self.read_again()

    def status_changed(self) -> None:
        super().status_changed()
        self._show_running()

    def second_passed(self) -> None:
        """Paint the times again, and ask how far what runs is."""
        super().second_passed()
        self._look()

    # -------------------------------------------------------------------------------------------------- moving

    def _more(self) -> None:
        """Ask for all of them, where only the newest are here."""
        if self.found is not None and len(self.found.recordings) < self.found.count and self._most < MOST:
            self._most = MOST
            self._asking = True
            self.read_again()

    def move(self, place: int) -> None:
        if place >= len(self.shown):
            self._more()
        super().move(place)

    def command_list_bottom(self) -> None:
        self._more()
        super().command_list_bottom()

    def filter_by(self, words: str) -> None:
        if words:
            self._more()
        super().filter_by(words)

    # ----------------------------------------------------------------------------------------- opening, fetching

    def command_list_read(self) -> None:
        self.read_again()

    def command_open_recording(self) -> None:
        one = self.here()
        if one is None or self.found is None:
            return
        if one.unfinished:
            self.say(f"{one.stem} is not finished: it is being written, or its writer died; the next start removes it")
            return
        file, context = rows.best_file(one), self.context
        what = f"opening {file.name}"
        context.open_over(self, what, open_recording, context, self.session, self.found.folder, file)

    enter = command_open_recording

    async def opener_of(self, one: SavedRecording) -> "Opener | None":
        from silo.analysis.opening import open_log

        folder = self.found.folder if self.found is not None else ""
        path = await brought_here(self.context, self.session, folder, rows.best_file(one))
        return (one.stem, partial(open_log, path)) if path is not None else None

    async def compare_logs(self, ways: Sequence[Opener]) -> None:
        from silo_tui.screens.lists.runs import show_differences  # with all that reads logs

        await show_differences(self, ways)

    def command_overlay_recording(self) -> None:
        targets = self.targets("nothing to lay over the plots here")
        if len(targets) > 1:
            self.say(f"one at a time lies over the plots, {len(targets)} are marked")
        if len(targets) != 1 or self.found is None:
            return
        (one,) = targets
        name = rows.short_stem(one.stem, self.session.status.logger, 30)
        if self.session.overlay is not None and self.session.overlay.name == name:
            self.session.overlay = None
            self.say(f"{name} is lifted off the plots")
            return
        run_alone(
            self, "opening", overlay_recording, self.context, self.session, self.found.folder, rows.best_file(one), name
        )

    def command_fetch_recording(self) -> None:
        targets = self.targets("nothing to fetch here")
        if not targets or self.found is None:
            return
        local = [path for one in targets if (path := here(self.found.folder, rows.best_file(one))) is not None]
        size = size_text(sum(one.size_bytes for one in targets))
        what = targets[0].stem if len(targets) == 1 else many(len(targets), "recording")
        body = f"{what}, {size}, to a folder of this machine"
        if local:
            body += f"\nIt lies on this machine already: {local[0]}"
        prompt = Prompt("Fetch", body, str(Path.cwd()), label="folder")
        ask_line(self, prompt, lambda folder: run_aside(self, "fetching", self._fetch, targets, folder))

    async def _fetch(self, targets: list[SavedRecording], given: str) -> None:
        with self.context.telling():
            folder = typed_path("the folder", given)
            for name in [file.name for one in targets for file in one.files]:
                if name in self.session.fetches:
                    self.say(f"{name} is being fetched already")
                    continue
                fetching = self.session.fetches[name] = Fetching(name)
                try:
                    with self.context.telling():
                        self.context.say(f"fetched: {await self.session.fetch(name, folder, fetching)}")
                except GivenUpError:
                    return
                finally:
                    self.session.fetches.pop(name, None)

    # --------------------------------------------------------------------------------------------------- recording

    def command_record(self, typed: Spelled = BY_KEY) -> None:
        self.context.run_flow(self._then_look(recorder.begin(self.context, self.session, self.found, typed.rest)))

    def command_stop_recording(self) -> None:
        self.context.run_flow(self._then_look(recorder.end(self.context, self.session)))

    async def _then_look(self, flow: Coroutine[Any, Any, None]) -> None:
        await flow
        self._show_running()

    # ---------------------------------------------------------------------------------------------------- deleting

    def command_delete_recording(self) -> None:
        targets = self.targets("nothing to delete here")
        foreign = [one for one in targets if not one.own]
        if not targets:
            return
        if foreign:
            whose = f"the logger {foreign[0].logger} wrote it" if foreign[0].logger else "it names no logger"
            why = f"was not saved by this logger ({whose})"
            if foreign[0].files[0].folder:
                why = "is a part of an endless recording, whose budget (keep) deletes the oldest"
            self.say(f"{foreign[0].stem} {why}: delete it on the robot; it is kept")
        else:
            self.context.run_flow(self._delete(targets))

    async def _delete(self, targets: Sequence[SavedRecording]) -> None:
        """Ask, and delete them."""
        size = size_text(sum(one.size_bytes for one in targets))
        what = targets[0].stem if len(targets) == 1 else many(len(targets), "recording")
        where = f"{self.session.status.host}:{self.found.folder}" if self.found is not None else ""
        names = [f"{file.name}  {size_text(file.size_bytes)}" for one in targets for file in one.files]
        body = f"From {where}, for good:\n" + and_more(names, 8, "\n")
        keep = "Keep it" if len(targets) == 1 else "Keep them"
        if await confirmed(self.app, f"Delete {what}, {size}?", body, f"Delete {size}", keep):
            self.say("deleting …")
            for one in targets:
                self.say(await self.session.delete_recording(one.stem))
                self._deleted_here.add(one.stem)
