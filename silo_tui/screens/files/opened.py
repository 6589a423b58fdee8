"""Opening a recording of the robot in place: the screens of a file above those of the logger, and back."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, TypeAlias

from silo.conditions.standing import TriggerStatus
from silo.core.elements import SavedFile
from silo.core.quantities.writing import duration, size_text
from silo.errors import SiloError
from silo.files.formats import kind_of
from silo.recordings.requests import RecordingFile
from silo_tui.actions import key_of
from silo_tui.context import Context, SiloScreen
from silo_tui.model.lists.conditions import MOST_PLOTS, named_in
from silo_tui.model.lists.recordings import begun_ns, best_file
from silo_tui.model.plots.overlay import overlay_of
from silo_tui.sessions.live import Session
from silo_tui.sessions.recordings import Fetching, GivenUpError, as_listed, bring_here, cache_folder, lies_here

if TYPE_CHECKING:
    from silo.analysis.log import Log
    from silo_tui.sessions.recorded import FileSession


Plots: TypeAlias = "Callable[[FileSession], list[str]]"


async def open_recording(
    context: Context, session: Session, folder: str, file: RecordingFile, plotted: "Plots | None" = None
) -> None:
    """Show a recording, with plots over its table where `plotted` says of what; at the first fire of a capture.

    One that isn't on this machine is fetched first, which is told.
    """
    asked_on = context.upper_screen
    found = await _opened(context, session, folder, file)
    if found is None:
        return
    path, opened = found
    if not context.is_still_on(asked_on):
        context.say(f"{file.name} is here: {path}")  # whoever asked went elsewhere meanwhile
        return
    await _show(context, opened, plotted(opened) if plotted is not None else ())
    if path.parent == cache_folder(session.status.host, session.name):
        context.say(f"fetched, {size_text(file.size_bytes)}: {path}")


async def show_read(
    context: Context, read: "Callable[[], Log]", failed: str, plotted: Sequence[str] = (), at_ns: int | None = None
) -> None:
    """Show a log that is read now, over the logger that is open; say that it `failed`, and why.

    Scalars that are `plotted` share a plot over its table, with the cursor at a moment.
    """
    with context.telling(failed):
        file = await asyncio.to_thread(_read, read)
        await _show(context, file, file.table.names if plotted else (), plotted, at_ns)


async def _show(
    context: Context,
    opened: "FileSession",
    names: Sequence[str] = (),
    alone: Sequence[str] = (),
    at_ns: int | None = None,
) -> None:
    """Show a file; where plots of `names` were asked for, at once over its table, which is not painted before.

    They stand still at a moment; of these scalars `alone` there is one plot for all.
    """
    from silo_tui.screens.files.file_table import FileTableScreen
    from silo_tui.screens.plots.monitor import MonitorScreen

    with context.app.batch_update():
        context.make_room()
        context.show_file(opened)
        await context.app.push_screen(FileTableScreen(opened, leave=context.leave_file))
        context.table_changed()
        context.status_changed()
        if not names:
            return
        monitor = MonitorScreen(opened, names)
        monitor.came_with_file = True
        if alone:
            monitor.stack.show_panels([tuple(each for each in monitor.stack.plots if each.name in alone)])
        await context.app.push_screen(monitor)
        if opened.capture is not None and opened.capture.fires_ns:
            at_ns = opened.capture.fires_ns[0]
        if at_ns is not None:
            monitor.call_after_refresh(monitor.show_moment_of, at_ns)


def _read(read: "Callable[[], Log]") -> "FileSession":
    """Read a log; with it come, in this thread too, the screens that show it: importing them takes long."""
    from silo_tui.screens.files import file_table  # noqa: F401
    from silo_tui.screens.plots import monitor  # noqa: F401
    from silo_tui.sessions.recorded import opened

    return opened(read)


async def overlay_recording(context: Context, session: Session, folder: str, file: RecordingFile, name: str) -> None:
    """Lay a recording over the live plots."""
    found = await _opened(context, session, folder, file)
    if found is not None:
        session.overlay = overlay_of(name, found[1].source)
        lifts = f"{key_of('overlay_recording')} again lifts it"
        context.say(f"{name} lies over the plots, with data {session.overlay.extent()}; {lifts}")


async def _opened(
    context: Context, session: Session, folder: str, file: RecordingFile
) -> "tuple[Path, FileSession] | None":
    """Return a recording, opened, and where it is on this machine; None, and told why, where it can't be."""

    def read(path: Path) -> "FileSession":
        from silo.analysis.opening import open_log

        return _read(lambda: open_log(path))

    path = await brought_here(context, session, folder, file)
    with context.telling(f"{file.name} can't be opened"):
        return (path, await asyncio.to_thread(read, path)) if path is not None else None
    return None


async def brought_here(context: Context, session: Session, folder: str, file: RecordingFile) -> Path | None:
    """Return where a recording is on this machine, fetched if it must be; None, and told why, where it can't be."""
    if file.name in session.fetches:
        context.say(f"{file.name} is on its way already")
        return None
    cache = cache_folder(session.status.host, session.name)
    lies = await asyncio.to_thread(lies_here, folder, file, cache)
    if lies is not None:
        return lies
    context.hold_no_longer()  # over a thin link it takes minutes
    fetching = session.fetches[file.name] = Fetching(file.name)
    try:
        with suppress(GivenUpError), context.telling(f"{file.name} can't be opened"):
            return await session.connection.aside(lambda client: bring_here(client, file, cache, fetching))
    finally:
        session.fetches.pop(file.name, None)
    return None


async def open_saved(
    context: Context, session: Session, files: list[SavedFile], plotted: "Plots | None" = None
) -> None:
    """Show what was just saved or captured, or saved when the robot program died; without `files`, the newest of these.

    `plotted` says of what plots are shown at once.
    """
    try:
        listed = await session.recordings()
    except SiloError as error:
        local = _on_this_machine(files)
        if local is None:
            context.fail(str(error))
        else:  # the link is cut, or its helper process has ended: the file is there all the same
            await open_recording(context, session, *local, plotted)
        return
    names = {PurePath(file.path).name for file in files}
    died = [one for one in listed.recordings if one.why.startswith("program died")]
    found = [one for one in listed.recordings if names & {file.name for file in one.files}] if names else died
    if not found:
        context.say(f"it is not in {listed.folder}; {key_of('recordings')} lists what is there")
        return
    newest = max(found, key=begun_ns)
    await open_recording(context, session, listed.folder, best_file(newest), plotted)


async def open_capture(context: Context, session: Session, trigger: TriggerStatus) -> None:
    """Plot what a trigger captured last: the signals of its condition, else the first ones."""
    files = [SavedFile(path, kind, 0) for path in trigger.files if (kind := kind_of(path)) is not None]

    def plotted(file: "FileSession") -> list[str]:
        names = [name for name in file.rows_of if file.rows_of[name].samples]
        known = named_in(trigger.options.when, file.table.elements, file.status.prefix)
        named = [name for name in known if name in names]
        return (named or names)[:MOST_PLOTS]

    await open_saved(context, session, files, plotted)


def open_last_capture(screen: SiloScreen, session: Session) -> None:
    """Plot what was captured last, of whichever trigger."""
    captured = [one for one in session.triggers if one.files]
    if captured:
        # a trigger that fires now has an older file until that capture is written
        last = max(captured, key=lambda one: one.whole.time_ns if one.whole is not None else one.last_ns)
        what = f"opening the last capture of {last.options.name}"
        screen.context.open_over(screen, what, open_capture, screen.context, session, last)
    elif under_way := [one for one in session.triggers if one.capturing_s]:
        options = under_way[0].options
        screen.say(
            f"the first capture of {options.name} is under way: it ends {duration(options.post_s)} after the last time "
            f"that it fires; {key_of('triggers')} shows it"
        )
    else:
        screen.say(f"no trigger has captured anything yet; {key_of('triggers')} lists them")


def _on_this_machine(files: list[SavedFile]) -> tuple[str, RecordingFile] | None:
    """Return folder and file of what was saved, if it lies here."""
    for file in files:
        path = Path(file.path)
        found = as_listed(path, file.type)
        if found is not None:
            return str(path.parent), found
    return None
