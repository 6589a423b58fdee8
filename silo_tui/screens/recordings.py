# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The recordings in the logger's folder on the robot: listed, opened in place, fetched, deleted."""

import asyncio
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from silo.core.quantities.writing import many, size_text
from silo.errors import SiloError
from silo.recordings.requests import Recordings, SavedRecording
from silo.rpc.frames import Frame
from silo_tui.actions import bindings_for
from silo_tui.context import Later, SiloScreen
from silo_tui.model import recorders
from silo_tui.model import recordings as rows
from silo_tui.model.lists import Marks
from silo_tui.model.paths import typed_path
from silo_tui.screens import recorder
from silo_tui.screens.dialogs import Choice, Prompt, Question
from silo_tui.screens.opened import open_recording, overlay_recording
from silo_tui.screens.order import OrderDialog
from silo_tui.sessions.live import Session
from silo_tui.sessions.recordings import Fetching, GivenUpError, here
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar, color
from silo_tui.widgets.inputs import Fleeting, Line

FOLLOW_S = 0.25
FIRST, MOST = 200, 10_000  # how many are asked for
LOOK_AGAIN_S = 0.3
FILTER_KEYS = "Enter keeps the filter  Esc clears it"


class RecordingsScreen(SiloScreen):
    """A list of what is saved; what is being recorded stands above it."""

    scope = "recordings"
    aside = True
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("recordings")

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.found: Recordings | None = None
        self._shown: list[SavedRecording] = []
        self.marks = Marks()
        self._deleted_here: set[str] = set()
        self._order, self._turned, self._words = "begun", False, ""
        self._said = ""
        self._most = FIRST

    def compose(self) -> ComposeResult:
        """Yield status, banner, what runs, titles, list, message, a line to type in, keys."""
        self.status_bar, self.banner = StatusBar(self.session, read_only=self.context.read_only), Banner(self.session)
        yield self.status_bar
        yield self.banner
        yield Static("", id="recordings-running", markup=False)
        yield Static("", id="recordings-head", markup=False)
        yield OptionList(id="recordings-list", markup=False)
        yield Static("", id="recordings-empty", markup=False)
        yield Static("", id="recordings-said", markup=False)
        yield Line(lambda line: [], "words of name, why and type; -not", "recordings-filter")
        yield KeyBar(self.scope, read_only=self.context.read_only)

    def on_mount(self) -> None:
        """Ask at once; follow what is fetched."""
        self._list.focus()
        self.banner.update()
        self._show_rows()
        self.read_again()
        self._look()
        self.set_interval(FOLLOW_S, self._follow)

    def on_resize(self, event: events.Resize) -> None:
        """Lay the columns out for another width."""
        self._show_rows()

    # ---------------------------------------------------------------------------------------------------- data

    def read_again(self) -> None:
        """Ask what there is."""
        if self.is_running and self.app.is_running:
            self.run_worker(Later(self._read), group="recordings", exclusive=True)

    async def _read(self) -> None:
        while True:
            try:
                found = await self.session.recordings(self._most)
            except SiloError as error:
                self._said = f"the list can't be read: {error}"
                break
            self.found = found
            self._said = "" if self._said.startswith("asking") else self._said
            self._show_rows()
            if not any(one.unread for one in found.recordings):
                break
            await asyncio.sleep(LOOK_AGAIN_S)  # what there was no time to look into
        self._tell()

    def _look(self) -> None:
        """Ask how endless recordings stand."""
        if self.session.connected and self.context.upper_screen is self:
            self.run_worker(Later(self._look_at_recorders), group="recorders", exclusive=True)

    async def _look_at_recorders(self) -> None:
        await self.context.quietly(self.session.refresh_recorders())
        self._show_running()

    def _show_running(self) -> None:
        """Draw what is being recorded; nothing where nothing is."""
        for lines in self.query("#recordings-running").results(Static):  # none of a screen that is gone
            lines.display = bool(self.session.recorders)
            lines.update(Text("\n").join(self._running_lines()))

    def _running_lines(self) -> list[Text]:
        session, width = self.session, max(40, self.size.width)
        found = [Text(recorders.head(width), "dim", no_wrap=True)]
        for one in session.recorders:
            row = recorders.row(one, session.table.names, session.paces.get(one.name), session.status.folder, width)
            line = Text(row, no_wrap=True, overflow="ellipsis")
            full = one.keep_bytes and one.size_bytes >= recorders.FULL_SHARE * one.keep_bytes
            caution = one.state in recorders.CAUTION or full or one.lost
            name = "error" if one.state in recorders.LOUD else "warning" if caution else "success"
            line.stylize(f"bold {color(self.app.theme_variables, name)}", 2, 6)
            found.append(line)
        return found

    def _show_rows(self) -> None:
        if not self.query("#recordings-list"):
            return  # the screen is gone
        lines = self._list
        found = self.found.recordings if self.found is not None else []
        kept = self._row.stem if self._row is not None else ""
        place = lines.highlighted or 0
        self._shown = rows.arranged(found, self._words, self._order, turned=self._turned)
        self.marks.keep(one.stem for one in found)
        width = max(40, self.size.width)
        self.query_one("#recordings-head", Static).update(rows.head(width))
        lines.clear_options()
        lines.add_options(Option(self._line(one, width), id=one.stem) for one in self._shown)
        if self._shown:
            stems = [one.stem for one in self._shown]
            lines.highlighted = self.marks.follow(kept, stems, place)
            if kept in self._deleted_here:
                self.marks.settle()
        empty = self.query_one("#recordings-empty", Static)
        lines.display, empty.display = bool(self._shown), not self._shown
        if not self._shown:
            empty.update(self._emptiness())
        self._tell()

    def _line(self, one: SavedRecording, width: int) -> Text:
        mark = " >" if one.stem in self.marks.keys else "  "
        words = Text(mark + rows.row(one, self.session.status.logger or self.session.name, width), no_wrap=True)
        if one.unfinished or one.unread or not self.session.connected:
            words.stylize("dim")
        return words

    def _emptiness(self) -> str:
        if self.found is None:
            return f"Asking {self.session.name} …"
        if self.found.recordings:
            return f"No recording has {self._words!r}. Esc clears the filter."
        return f"Nothing is saved in {self.found.folder} yet. w in the table or the plots saves what is held."

    def _tell(self) -> None:
        """Fill the message line: what was said last, else what there is."""
        parts = [fetching.words for fetching in self.session.fetches.values()]
        found = self.found
        if self._said:
            parts.insert(0, self._said)
        elif found is not None:
            marked = [f"{len(self.marks.keys)} marked"] if self.marks.keys else []
            order = [f"by {self._order}"] if self._order != "begun" or self._turned else []
            count = rows.summary(found, len(self._shown), self._words)
            parts = [count, *marked, *order, *parts]
        for line in self.query("#recordings-said").results(Static):  # none of a screen that is gone
            line.update(" " + " │ ".join(parts))

    def _follow(self) -> None:
        if self.session.fetches:
            self._tell()

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        """Follow what was saved, captured or deleted."""
        if self.context.upper_screen is self:
            self.read_again()

    def status_changed(self) -> None:
        """Follow a change of state or link."""
        self.status_bar.update()
        self.banner.update()
        self._show_rows()
        self._show_running()

    def live_changed(self, frame: Frame) -> None:
        """Show the state."""
        self.status_bar.update()

    def second_passed(self) -> None:
        """Paint the times again, and ask how far what runs is."""
        self.status_bar.update()
        self.banner.update()
        self._look()

    def say(self, words: str) -> None:
        """Show the result of something."""
        self._said = words
        self._tell()

    def say_whole(self, words: str) -> bool:
        """Show a long message in as many lines as it takes."""
        self.say(words)
        return True

    # -------------------------------------------------------------------------------------------------- moving

    @property
    def _list(self) -> OptionList:
        return self.query_one("#recordings-list", OptionList)

    @property
    def _row(self) -> SavedRecording | None:
        place = self._list.highlighted
        return self._shown[place] if place is not None and place < len(self._shown) else None

    def _more(self) -> None:
        """Ask for all of them, where only the newest are here."""
        if self.found is not None and len(self.found.recordings) < self.found.count and self._most < MOST:
            self._most = MOST
            self.say("asking for the older ones …")
            self.read_again()

    def _move(self, lines: int) -> None:
        if lines > 0 and (self._list.highlighted or 0) + lines >= len(self._shown):
            self._more()
        if self._shown:
            self._list.highlighted = max(0, min((self._list.highlighted or 0) + lines, len(self._shown) - 1))

    def command_next_recording(self) -> None:
        self._move(1)

    def command_previous_recording(self) -> None:
        self._move(-1)

    def command_first_recording(self) -> None:
        self._move(-len(self._shown))

    def command_last_recording(self) -> None:
        self._move(len(self._shown))

    def command_recordings_down(self) -> None:
        self._move(max(1, self._list.size.height - 1))

    def command_recordings_up(self) -> None:
        self._move(-max(1, self._list.size.height - 1))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Open what is clicked."""
        event.stop()
        self.command_open_recording()

    # ------------------------------------------------------------------------------------------ filter, order, marks

    def command_mark_recording(self) -> None:
        if self._row is not None:
            self.marks.toggle(self._row.stem)
            self._move(1)
            self._show_rows()

    def command_mark_recordings(self) -> None:
        self.marks.toggle_all([one.stem for one in self._shown])
        self._show_rows()

    def command_range_of_recordings(self) -> None:
        if self._row is not None:
            self.say(self.marks.range_to(self._row.stem, [one.stem for one in self._shown]))
            self._show_rows()

    def command_order_recordings(self) -> None:
        letters = {order.name: order.letter for order in rows.ORDERS}
        words = {order.name: order.words for order in rows.ORDERS}
        backwards = rows.BY_NAME[self._order].backwards != self._turned
        self.app.push_screen(
            OrderDialog(list(letters), self._order, "↓" if backwards else "↑", letters, words), self._by
        )

    def _by(self, order: str | None) -> None:
        if order is not None:
            self._turned = not self._turned if order == self._order else False
            self._order, self._said = order, ""
            self._show_rows()

    def command_filter_recordings(self) -> None:
        self.query_one(KeyBar).show_instead(FILTER_KEYS)
        self.query_one("#recordings-said").display = False
        self.query_one("#recordings-filter", Line).begin(self._words)

    def on_input_changed(self, event: Input.Changed) -> None:
        """Filter while it is typed."""
        if event.input.id == "recordings-filter" and event.input.display:
            self._filter_by(event.input.value)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Keep the filter."""
        self._back_to_list()
        self._filter_by(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Clear the filter."""
        self._back_to_list()
        self._filter_by("")

    def _filter_by(self, words: str) -> None:
        self._words, self._said = words, ""
        if words:
            self._more()
        self._show_rows()
        self.marks.settle()

    def _back_to_list(self) -> None:
        self.query_one("#recordings-said").display = True
        self.query_one(KeyBar).show_instead("")
        self._list.focus()

    # ----------------------------------------------------------------------------------------- opening, fetching

    def command_read_recordings(self) -> None:
        self._said = ""
        self.read_again()

    def command_open_recording(self) -> None:
        one = self._row
        if one is None or self.found is None:
            return
        if one.unfinished:
            self.say(f"{one.stem} is not finished: it is being written, or its writer died; the next start removes it")
            return
        self._said = ""
        self.run_worker(
            Later(open_recording, self.context, self.session, self.found.folder, rows.best_file(one)),
            group="opening", exclusive=True,
        )  # fmt: skip

    def command_overlay_recording(self) -> None:
        one = self._row
        if one is None or self.found is None or one.unfinished:
            self.say("nothing to lay over the plots here")
            return
        name = rows.short_stem(one, self.session.status.logger, 30)
        if self.session.overlay is not None and self.session.overlay.name == name:
            self.session.overlay = None
            self.say(f"{name} is lifted off the plots")
            return
        self.run_worker(
            Later(overlay_recording, self.context, self.session, self.found.folder, rows.best_file(one), name),
            group="opening", exclusive=True,
        )  # fmt: skip

    def _targets(self) -> list[SavedRecording]:
        """Return what a key is about, never what is unfinished."""
        meant = self.marks.meant([one.stem for one in self._shown], self._row.stem if self._row is not None else "")
        return [one for one in self._shown if one.stem in meant and not one.unfinished]

    def _none(self, what: str) -> str:
        """Return why a key is about nothing."""
        shown = [one.stem for one in self._shown]
        return self.marks.why_none(shown, self._row.stem if self._row is not None else "") or what

    def command_fetch_recording(self) -> None:
        targets = self._targets()
        if not targets or self.found is None:
            self.say(self._none("nothing to fetch here"))
            return
        local = [path for one in targets if (path := here(self.found.folder, rows.best_file(one))) is not None]
        size = size_text(sum(one.size_bytes for one in targets))
        what = targets[0].stem if len(targets) == 1 else many(len(targets), "recording")
        body = f"{what}, {size}. To which folder of this machine?"
        if local:
            body += f"\nIt lies on this machine already: {local[0]}"
        self.app.push_screen(Prompt("Fetch", body, str(Path.cwd())), lambda folder: self._fetch_to(targets, folder))

    def _fetch_to(self, targets: list[SavedRecording], folder: str | None) -> None:
        if folder:
            self.run_worker(Later(self._fetch, targets, folder), group="fetching")

    async def _fetch(self, targets: list[SavedRecording], given: str) -> None:
        try:
            folder = typed_path("the folder", given)
        except SiloError as error:
            self.context.fail(str(error))
            return
        for name in [file.name for one in targets for file in one.files]:
            if name in self.session.fetches:
                self.say(f"{name} is being fetched already")
                continue
            fetching = self.session.fetches[name] = Fetching(name)
            try:
                path = await self.session.fetch(name, folder, fetching)
            except GivenUpError:
                return
            except (SiloError, OSError) as error:
                self.context.fail(str(error))
            else:
                self.context.say(f"fetched: {path}")
            finally:
                self.session.fetches.pop(name, None)

    # --------------------------------------------------------------------------------------------------- recording

    def command_record(self) -> None:
        free = self.found.free_bytes if self.found is not None else 0
        self.context.run_flow(self._then_look(recorder.begin(self.context, self.session, free)))

    def command_stop_recording(self) -> None:
        self.context.run_flow(self._then_look(recorder.end(self.context, self.session)))

    async def _then_look(self, flow: Coroutine[Any, Any, None]) -> None:
        await flow
        self._show_running()

    # ---------------------------------------------------------------------------------------------------- deleting

    def command_delete_recording(self) -> None:
        targets = self._targets()
        foreign = [one for one in targets if not one.own]
        if not targets:
            self.say(self._none("nothing to delete here"))
        elif foreign:
            whose = f"the logger {foreign[0].logger} wrote it" if foreign[0].logger else "it names no logger"
            why = f"was not saved by this logger ({whose})"
            if foreign[0].files[0].folder:
                why = "is a part of an endless recording, whose budget (keep) deletes the oldest"
            self.say(f"{foreign[0].stem} {why}: delete it on the robot; it is kept")
        else:
            size = size_text(sum(one.size_bytes for one in targets))
            what = targets[0].stem if len(targets) == 1 else many(len(targets), "recording")
            where = f"{self.session.status.host}:{self.found.folder}" if self.found is not None else ""
            names = [f"{file.name}  {size_text(file.size_bytes)}" for one in targets for file in one.files]
            more = [f"and {len(names) - 8} more"] if len(names) > 8 else []
            body = "\n".join([f"From {where}, for good:", *names[:8], *more])
            choices = [
                Choice("no", "Keep it" if len(targets) == 1 else "Keep them"),
                Choice("yes", f"Delete {size}", "y"),
            ]
            self.app.push_screen(
                Question(f"Delete {what}, {size}?", body, choices), lambda answer: self._delete(targets, answer)
            )

    def _delete(self, targets: list[SavedRecording], answer: str | None) -> None:
        if answer == "yes":
            self.run_worker(Later(self._deleted, targets), group="deleting")

    async def _deleted(self, targets: list[SavedRecording]) -> None:
        self.say("deleting …")
        try:
            for one in targets:
                self.say(await self.session.delete_recording(one.stem))
                self._deleted_here.add(one.stem)
        except SiloError as error:
            self.context.fail(str(error))
        self.read_again()

    def command_back(self) -> None:
        """Leave the filter, then the marks, then the screen."""
        if self._words:
            self._filter_by("")
        elif self.marks.clear():
            self._show_rows()
        else:
            self.context.leave_screen()
