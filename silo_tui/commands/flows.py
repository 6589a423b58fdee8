"""What takes several steps with questions in between: starting, stopping, applying, scripts, quitting, control.

Each flow is a coroutine that runs in a worker of the app; errors of the logger are shown as they are worded. At its end
`Context.run_flow` has the screens follow what it changed: a flow tells them only before it asks something else.
"""

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import msgspec
from rich.text import Text

from silo.core.conditions import TriggerWord
from silo.core.elements import FieldChange
from silo.core.names import did_you_mean, nearest
from silo.core.quantities.writing import and_more, duration, many, wall_clock
from silo.errors import RefusedError
from silo.net.access.senders import name_of, short_words
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy
from silo.segment.retention import end_text, new_end_text
from silo.state.requests import Unsaved
from silo_tui.actions import BY_ID, key_of
from silo_tui.context import Context
from silo_tui.model.table.changes import cost_of, kept_by
from silo_tui.model.table.fields import Field, phrase_for
from silo_tui.model.table.state import PendingChange
from silo_tui.model.words import text
from silo_tui.model.words.people import operators, people_words
from silo_tui.screens.dialogs.questions import Choice, Prompt, Question, confirmed, cost_text, diff_text, end_words
from silo_tui.sessions.live import Session, why
from silo_tui.settings.file import path as settings_path
from silo_tui.settings.options import changed

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.scripts.requests import ScriptDiff

GOES_ON = "{} and go on saves what its buffers hold (looping ones: the newest alone) and begins them empty."
SPLIT = "Stopping ends this run."


async def start_stop(context: Context) -> None:
    """Start a stopped logger; stops a running one after asking."""
    session = context.session
    if not session.running:
        unsaved = await _start_over(context) if _is_unsaved(context.session) else Unsaved.REFUSE
        if unsaved is None:
            return
        try:
            told = await session.start(unsaved)
        except RefusedError as refused:
            if why(refused) is not RefusedWhy.RUNNING:
                raise
            await session.refresh_status()
            await session.learn_events()
            starts = [one for one in session.happened if one.kind == EventKind.STARTED.value]
            by = "".join(f", by {short_words(one.who)} at {wall_clock(one.time_ns)}" for one in starts[-1:])
            context.say(f"somebody was faster: it was started already{by}")
        else:
            context.say("; ".join(["started", *told]))
    else:
        body = f"What was logged stays in memory; {context.key_in_table('save_data')} saves it."
        choices = [Choice("", "No"), Choice("stop", "Stop", "y"), Choice("save", "Stop and save", "s")]
        choices.append(Choice("restart", "Stop and start again: asks what becomes of the data", "r"))
        answer = await context.app.push_screen_wait(Question("Stop logging?", body, choices))
        if answer == "stop":
            await session.stop()
            context.say(f"stopped; {context.key_in_table('save_data')} saves the data")
        elif answer == "save":
            await _stop_and_save(context)
        elif answer == "restart":
            await restart(context)


async def restart(context: Context) -> None:
    """Stop and starts after asking."""
    session = context.session
    unsaved: Unsaved | None = Unsaved.REFUSE
    if session.running:
        answer = await _ask_around(
            context, "Restart logging?", Text(SPLIT), [Choice("", "Don't restart")], "restart", "y"
        )
        if answer is None:
            return
        unsaved = _decided(answer)
    elif _is_unsaved(context.session):
        unsaved = await _start_over(context)
    if unsaved is None:
        return
    context.say("; ".join(["restarted", *await session.start(unsaved, again=True)]))


def _is_unsaved(session: Session) -> bool:
    """Return whether a new start would drop something."""
    status = session.status
    return not status.saved and status.run_ticks > 0


def _held(context: Context) -> str:
    """Return what the buffers hold, in words: the longest holds so much, of most ticks they may have forgotten all."""
    status = context.session.status
    return f"{many(status.held_samples, 'sample')}, {duration(status.held_s)} at most"


def _decided(answer: str) -> Unsaved:
    """Return what an answer of `_ask_around` says of unsaved data; of what came since it was given, nothing."""
    return Unsaved.DISCARD if answer == "drop" else Unsaved.REFUSE


async def _start_over(context: Context) -> Unsaved | None:
    """Ask what becomes of the last recording; None: it is not to be started."""
    held = _held(context)
    body = f"The last recording ({held}) is not saved, and starting drops it."
    choices = [
        Choice("save", "Save it, then start", "s"), Choice("", "Don't start"),
        Choice("drop", f"Drop {held} and start", "D", loses=True),
    ]  # fmt: skip
    answer = await context.app.push_screen_wait(Question("Start again?", body, choices))
    if answer == "save":
        return Unsaved.REFUSE if await _save_all(context) else None
    return Unsaved.DISCARD if answer == "drop" else None


async def _ask_around(
    context: Context, title: str, body: Text, first: Sequence[Choice], steps: str, key: str, last: Sequence[Choice] = ()
) -> str | None:
    """Ask before a running logger is stopped and started again; None, an answer of the others, "save", "drop" or "go".

    "save": it was stopped, and what was logged is saved. "drop": it is to be dropped. "go": there is nothing to save.
    """
    await context.session.refresh_status()  # it may have been saved, and gone on since
    choices = [*first]
    if _is_unsaved(context.session):
        held = _held(context)
        choices += [Choice("save", f"Save, {steps}", "s"), Choice("drop", f"Drop {held}: {steps}", "D", loses=True)]
    else:
        choices.append(Choice("go", steps[:1].upper() + steps[1:], key))
    answer: str | None = await context.app.push_screen_wait(Question(title, body, [*choices, *last]))
    return None if answer == "save" and not await _stop_and_save(context) else answer


async def _stop_and_save(context: Context) -> bool:
    """Stop, then saves, so that the last tick is in the file too. False: stopped, but not saved."""
    await context.session.stop()
    context.status_changed()
    if await _save_all(context):
        return True
    saves = f"{context.key_in_table('save_data')} saves it"
    context.say(f"stopped and not saved: nothing else was done, the data is still there ({saves})")
    return False


async def _save_all(context: Context) -> bool:
    from silo_tui.screens.files.save_data import SaveDialog

    if not (files := await context.app.push_screen_wait(SaveDialog(context, at_once=True, go_on=True))):
        return False
    context.saved_first(files)
    return True


async def apply(context: Context) -> None:
    """Show what would change and applies it as one transaction; offers to stop and start again around it."""
    session = context.session
    while True:
        changes = session.table.changes()
        if not changes:
            context.say("nothing is pending")
            return
        if any(change.theirs is not None for change in changes) and not await _settle_conflicts(context):
            return
        changes = session.table.changes()
        if not changes:
            context.say("nothing is pending any more")
            return
        answer = await _ask_to_apply(context, changes)
        if answer == "discard":
            session.table.discard(list(range(len(session.table))))
            context.say(f"all pending edits discarded; {context.key_in_table('undo')} brings them back")
        if answer not in {"apply", "cut", "save", "drop", "go"}:
            return
        around = answer not in {"apply", "cut"}
        if await _carry_out(context, around=around, cut=answer == "cut", unsaved=_decided(answer)):
            return


async def _ask_to_apply(context: Context, changes: Sequence[PendingChange]) -> str | None:
    elements = len({change.name for change in changes})
    title = f"Apply {many(len(changes), 'edit')} to {many(elements, 'element')}?"
    keep = Choice("", f"Keep them pending{_drops_one(context) if elements > 1 else ''}")
    discard = Choice("discard", f"Discard all edits; {context.key_in_table('undo')} brings them back", "x")
    end = _new_end(context.session)
    body = _what_changes(context, changes, end)
    if context.session.running:
        told = f"{GOES_ON.format('Apply')}{_watching_again(context.session)} {SPLIT}\n"
        body = Text(told, style="bold").append_text(body)  # first: what all costs may be out of sight
        go_on = Choice("cut", f"Apply and go on: no tick is lost{_until_it_stops(context.session, end)}", "a")
        return await _ask_around(context, title, body, [go_on, keep], "stop, apply, start again", "r", [discard])
    return await context.app.push_screen_wait(Question(title, body, [Choice("apply", "Apply", "a"), keep, discard]))


def _until_it_stops(session: Session, end: str) -> str:
    """Return when a run that goes on will have come to its end, where that is something new."""
    return f" until it stops, after {session.status.max_time_s:g} s" * bool(end)


def _drops_one(context: Context) -> str:
    """Return how the edits of one element alone are dropped: with marks the key is about all of these."""
    unmark = f"{key_of('unmark') or ':unmark'}, then " if context.session.rows.marked_count else ""
    return f"; to drop one: {unmark}{context.key_in_table('discard')} on its line"


def _watching_again(session: Session) -> str:
    """Return which triggers of mode single have fired: with a new run they may once more."""
    fired = [f"'{one.options.name}'" for one in session.triggers if one.state is TriggerWord.FIRED]
    if not fired:
        return ""
    verb = "watches" if len(fired) == 1 else "watch"
    return f" {' and '.join(fired[:3])}{' ...' * (len(fired) > 3)}, fired already, then {verb} again."


def _new_end(session: Session) -> str:
    """Return that the logger will stop by itself with what is pending, which it would not without; else nothing."""
    table = session.table
    before, after = (kept_by(table.elements[: table.own], values) for values in (table.server, table.values))
    return new_end_text(before, after, session.status.max_time_s)


def _what_changes(context: Context, changes: Sequence[PendingChange], end: str) -> Text:
    """Return the edits in groups, and what the table takes before and after; first that it will `end`, in words."""
    session, table = context.session, context.session.table
    own = table.elements[: table.own]  # what is derived takes no memory
    edited = {change.name for change in changes}
    now, after = (cost_of(table.elements, each, session.rate_hz, edited) for each in (table.server, table.values))
    stops = bool(end_text(kept_by(own, table.values), session.status.max_time_s))
    cost = cost_text(now, after, session.short_name(after.shortest), session.status.room_bytes, stops=stops)
    first = Text(end_words(end), style="bold")
    return first.append_text(diff_text(changes, table.prefix, cost))


async def _carry_out(context: Context, *, around: bool, cut: bool, unsaved: Unsaved) -> bool:
    """Apply; False when somebody else was faster and the edits are to be looked at again."""
    session = context.session
    try:
        if around and session.running:
            await session.stop()
        applied = await session.apply(cut=cut)
    except RefusedError as refused:
        context.table_changed()
        if around:
            await session.start(unsaved)
        if why(refused) is RefusedWhy.CONFLICT:
            context.say("somebody else changed the table meanwhile: look again")
            return False
        if why(refused) is RefusedWhy.RUNNING and not cut:
            await session.refresh_status()
            context.status_changed()
            return False
        raise
    told = await session.start(unsaved) if around else []
    went = ", logging again" if around else ", it goes on" if cut else ""
    back = [f"{context.key_in_table('undo')} takes it back, as edits to apply"] * bool(session.table.undoes)
    # first what works and is likely not meant, as the shell tells it: that it stops by itself, buffers of gigabytes
    news = dict.fromkeys([*applied.warnings, *told])
    context.say("; ".join([f"applied to {many(applied.changed, 'element')}{went}", *news, *back]))
    return True


async def _settle_conflicts(context: Context) -> bool:
    table = context.session.table
    conflicts = [change for change in table.changes() if change.theirs is not None]
    body = Text("Somebody else changed the same fields since you edited them:\n\n")
    for change in conflicts[:200]:
        body.append(f"{context.session.short_name(change.name)}\n", style="bold")
        body.append(f"  {change.field}: was {change.old}, theirs {change.theirs}, yours {change.new}\n")
    if len(conflicts) > 200:
        body.append(f"and {len(conflicts) - 200} more\n")
    choices = [
        Choice("", f"Decide later (look at each: {context.key_in_table('discard')} takes theirs)"),
        Choice("theirs", "Take theirs", "t", loses=True),
        Choice("mine", "Keep yours", "y", loses=True),
    ]
    answer = await context.app.push_screen_wait(Question(f"Settle {many(len(conflicts), 'conflict')}?", body, choices))
    if answer not in {"theirs", "mine"}:
        return False
    table.resolve(list(range(len(table))), keep_mine=answer == "mine")
    context.table_changed()
    return True


async def _chosen_script(context: Context, path: str) -> "tuple[str, ScriptDiff | None]":
    """Return the script to load once its difference was seen, and that; "" for none."""
    from silo_tui.screens.dialogs.scripts import AS_BEGUN, script_diff_text, scripts_question

    link, table, name, seen = context.link, context.session.table, _script_name(path), False
    if not path:
        scripts = await link.read(lambda client: client.scripts())
        otherwise = [name for name, is_edited in zip(table.names, table.edited, strict=True) if is_edited]
        dialog = scripts_question(link, scripts, _pending(context), table.prefix, otherwise)
        chosen: str | None = await context.app.push_screen_wait(dialog)
        name = chosen or ""
        seen = dialog.told == name
    if name == AS_BEGUN:
        count = table.begin_again()
        context.table_changed()
        context.say(f"{many(count, 'edit')} back to what the program began with: {key_of('apply')} applies")
    if name in ("", AS_BEGUN):
        return "", None
    diff = await link.read(lambda client: client.diff_script(name))
    if not diff.changes and not diff.conditions:
        edits = _pending(context)
        kept = f"; kept: {edits} ({context.key_in_table('discard')} takes back those of an element)" if edits else ""
        context.say(f"{name} says what the logger has already: nothing to load{kept}{_unknown_words(diff.unknown)}")
        return "", None
    if seen:
        return name, diff
    choices = [Choice("load", f"Load {name}", "l"), Choice("", "Don't")]
    question = Question(f"Load {diff.path}?", script_diff_text(diff, context.session.table.prefix), choices)
    return (name if await context.app.push_screen_wait(question) == "load" else ""), diff


async def load_script(context: Context, path: str = "") -> None:
    """Choose a script, shows what it would change, loads it."""
    session, link = context.session, context.link
    name, diff = await _chosen_script(context, path)
    if not name or diff is None:
        return
    if edits := _pending(context):
        body = f"{edits} stay pending on top of the script."
        if not await confirmed(context.app, "Load over pending edits?", body, "Load"):
            return
    around, cut, unsaved = False, False, Unsaved.REFUSE
    if session.running:
        body_text = Text(end_words(diff.end), style="bold")
        body_text.append(f"{GOES_ON.format('Load')}{_watching_again(session)} {SPLIT}", style="not bold")
        go_on = Choice("cut", f"Load and go on: no tick is lost{_until_it_stops(session, diff.end)}", "l")
        first, steps = [go_on, Choice("", "Don't load")], "stop, load, start again"
        answer = await _ask_around(context, f"Load {name} while it runs?", body_text, first, steps, "y")
        if answer is None:
            return
        cut, unsaved = answer == "cut", _decided(answer)
        around = not cut
        if around and session.running:
            await session.stop()
    told_of_start: list[str] = []
    table, names, before = session.table, session.table.names, session.table.server
    try:
        loaded = await link.call(lambda client: client.load_script(name, cut=cut))
    finally:
        if around:
            told_of_start = await session.start(unsaved)
    await session.reload()
    if not edits:  # else they are what is taken back first
        table.note_changed(names, before)
    if diff.conditions:
        await session.refresh_conditions()
    told = (
        f"{many(loaded.changed, 'element')} changed{_conditions_words(diff.conditions)}{_unknown_words(loaded.unknown)}"
    )
    went = ["it goes on" if cut else "logging again"] * (cut or around)
    context.say("; ".join([f"loaded {name}: {told}", *went, *dict.fromkeys([*loaded.warnings, *told_of_start])]))


def _conditions_words(conditions: Sequence[FieldChange]) -> str:
    """Return which derived signals, limits and triggers a script changed, the first few by name."""
    names = list(dict.fromkeys(change.name for change in conditions))
    return f"; {and_more(names, 3)}" if names else ""


def _unknown_words(names: Sequence[str]) -> str:
    """Return how many names of a script the table doesn't have."""
    return f"; not in the table: {many(len(names), 'name')} of it" if names else ""


def _script_name(given: str) -> str:
    """Return a name with the ending that the logger asks for; empty stays the logger's own script."""
    return given if not given or given.endswith((".yaml", ".yml")) else f"{given}.yaml"


async def save_script(context: Context, path: str | None = None) -> None:
    """Store the table of the logger as a script on the robot."""
    session = context.session
    if path is None:
        fields, _ = session.table.pending_count
        current = session.status.script.rpartition("/")[2]
        scripts = await context.link.read(lambda client: client.scripts())
        body = f"in {scripts.folder}, on the robot"
        if current:
            body += f"\n{current} is what the program reads when it starts again."
        if fields:
            body += f"\n{many(fields, 'pending edit')} will not be in it: apply them first."
        prompt = Prompt("Save the script", body, current, "name.yaml", label="name")
        path = await context.app.push_screen_wait(prompt)
    if path is None:
        return
    name = _script_name(path)
    ending = ": scripts end in .yaml" if name != path else ""
    title = f"Overwrite {name or 'the script'}?"
    said = await keep_on_robot(context, title, "Overwrite", lambda client, again: client.save_script(name, again))
    if said is None:
        return
    fields, _ = session.table.pending_count
    without = f"{many(fields, 'pending edit')} not in it; " if fields else ""  # first: the path may be long
    differs = f"; {key_of('load_script')} shows what differs"
    context.say(without + (said or f"script saved: {name}") + ending + differs)


async def keep_on_robot(context: Context, title: str, verb: str, keep: Callable[["Client", bool], str]) -> str | None:
    """Keep something on the robot, over what has its name only after a question; None where that stays."""
    link = context.link
    try:
        return await link.call(lambda client: keep(client, False))
    except RefusedError as refused:
        if why(refused) is not RefusedWhy.EXISTS:
            raise
        sure = await confirmed(context.app, title, str(refused), verb)
    return await link.call(lambda client: keep(client, True)) if sure else None


async def restore(context: Context) -> None:
    """Set again what was judged and derived before the robot program started anew."""
    lent = context.session.lent
    if not lent.gone and not lent.gone_edits:
        context.say("nothing is gone: what is derived and judged stays with the robot program, or its script has it")
        return
    done, refused, edits = await lent.restore()
    told = [f"refused: {one}" for one in refused]
    told += [f"{many(edits, 'edit')} pending again: {key_of('apply')} applies"] * bool(edits)
    left = len(lent.gone_edits)
    told += [f"{many(left, 'edit')} left out: of elements that are not there; :restore again once they are"] * bool(
        left
    )
    told += [f"set again: {and_more(done, 3)}"] * bool(done)
    told += [f"{key_of('save_script')} keeps it in the script"] * bool(edits or done)
    context.say("; ".join(told))


def _pending(context: Context) -> str:
    """Return how many edits are pending, in words; empty for none."""
    fields, elements = context.session.table.pending_count if context.has_session else (0, 0)
    return f"{many(fields, 'pending edit')} in {many(elements, 'element')}" if fields else ""


async def may_leave(context: Context) -> bool:
    """Ask before another logger is opened while edits of this one are pending."""
    if not (edits := _pending(context)):
        return True
    if not await confirmed(context.app, f"Leave {context.session.name}?", f"{edits} of it would be lost.", "Leave"):
        return False
    forget_edits(context)
    return True


async def leave(context: Context) -> None:
    """End the app; asks where edits are pending, where a demo ends with it, and where settings are not written."""
    session = context.logger_session
    edits, ends_robot = _pending(context), context.has_demo() and session is not None and not session.dead
    if edits or ends_robot:
        goes_on = "The logger goes on."
        if ends_robot:
            goes_on = "The demo robot ends with silo-tui; what it logged is saved."
        elif session is not None and session.dead:
            in_file = and_more([file.path for file in session.left_files], 3)
            goes_on = (
                f"The robot program is dead; its data is in {in_file}." if in_file else "The robot program is dead."
            )
        title = "Quit without applying?" if edits else "Quit, and end the demo?"
        body = f"{edits} would be lost. {goes_on}" if edits else goes_on
        if not await confirmed(context.app, title, body, "Quit", loses=bool(edits)):
            return
        forget_edits(context)
    if not await _settings_decided(context):
        return
    context.left()
    context.app.exit()


async def _settings_decided(context: Context) -> bool:
    """Ask once whether settings that were changed are kept, and write them; False: the app is not to end."""
    saved, now = context.saved_settings, context.settings
    if now in (saved, context.begun_settings):
        return True
    from silo_tui.settings.writing import write_file

    names = and_more([*changed(saved, now), *["keys"] * (now.keys != saved.keys)], 3)
    choices = [
        Choice("keep", "Write to the file, and quit", "w"), Choice("", "Don't quit"),
        Choice("drop", f"Quit without: {names} as before", "D", loses=True),
    ]  # fmt: skip
    body = f"Changed: {names}. The file: {settings_path()}"
    answer = await context.app.push_screen_wait(Question("Keep the settings?", body, choices))
    if answer == "keep":
        write_file(saved, now)
    return answer is not None


def left_words(session: Session) -> str:
    """Return how a logger is left as the app ends: what goes on without it, and what no file has."""
    status, name = session.status, session.name
    if session.link is None or not status.logger:
        return ""
    if session.dead:
        saved = f": {', '.join(file.path for file in session.left_files)}" if session.left_files else ""
        return f"{name} is dead{saved}"
    if session.running:
        recorded = f", {many(status.recorders, 'recording')} with it" if status.recorders else ""
        return f"{name} logs on{recorded}"
    if not _is_unsaved(session):
        return f"{name} is stopped"
    return f"{name} is stopped, and {many(status.run_ticks, 'tick')} stand in no file: `silo save {name}`"


def forget_edits(context: Context) -> None:
    """Drop what is pending, so that it isn't offered at the next start."""
    table = context.session.table
    table.discard(list(range(len(table))))
    context.keep_edits()


async def take_up_edits(context: Context) -> None:
    """Offer edits that a lost terminal, or a kill, left behind."""
    from silo_tui.sessions import kept

    session = context.session
    files = kept.left_behind(session.status.host, session.name)
    edits = [edit for found in files.values() for edit in found.edits]
    newest_s = max((found.time_s for found in files.values()), default=0.0)
    when = text.day_and_time(round(newest_s * 1e9), time.time())
    body = Text(f"They were pending when silo-tui ended, {when}. The logger has none of them.\n\n")
    changes = []
    for edit in edits:
        if session.table.row(edit.name) is not None and 0 <= edit.field < len(Field):
            field = Field(edit.field)
            old, new = phrase_for(field, edit.old), phrase_for(field, edit.new)
            changes.append(PendingChange(edit.name, field.label, old, new))
    body.append_text(diff_text(changes, session.table.prefix))
    choices = [Choice("take", "Take them up again, pending", "t"), Choice("", "Ask again next time"),
               Choice("drop", "Drop them", "D", loses=True)]  # fmt: skip
    question = Question(f"Take up {many(len(edits), 'edit')} of {session.name} again?", body, choices)
    answer = await context.app.push_screen_wait(question)
    if answer not in {"take", "drop"}:
        return
    for path in files:
        path.unlink(missing_ok=True)
    if answer == "take":
        taken = session.table.take_up(edits)
        context.say(f"{many(taken, 'edit')} pending again; {context.key_in_table('undo')} takes that back")
    context.keep_edits()


CONTROL_WORDS = "take, force (from whoever has it), release, give NAME; alone, who is connected"


async def control_flow(context: Context, words: Sequence[str]) -> None:
    """Take, release or give away control, or tell who has it. RefusedError where somebody else has it."""
    session = context.session
    jobs: dict[str, Callable[[Client], str]] = {
        "take": lambda client: client.take_control(),
        "force": lambda client: client.take_control(force=True),
        "release": lambda client: client.release_control(),
        "give": lambda client: client.give_control(words[1]),
    }
    if not words:
        await session.refresh_status()
        words = await _ask_for_control(context)
    if not words:
        return
    if words[0] not in jobs:
        hint = did_you_mean(nearest(words[0], jobs), CONTROL_WORDS)
        raise RefusedError(f"control: there is no {words[0]!r}{hint}")
    if len(words) != (2 if words[0] == "give" else 1):
        raise RefusedError(f"control: {CONTROL_WORDS}")
    if context.allows(msgspec.structs.replace(BY_ID["control"], writes=True)):
        done = await session.connection.call(jobs[words[0]])
        await session.refresh_status()
        if words[0] in ("take", "force"):  # which silo-tui renews
            name = session.status.logger
            done = f"you have control of {name} until you release it or leave; your own programs may still change it"
        context.say(done)


async def _ask_for_control(context: Context) -> Sequence[str]:
    """Tell who has control, and ask what becomes of it: the word for it, none for nothing."""
    session = context.session
    told = people_words(session.status, session.identity, session.own_name)
    if not session.may_edit:
        context.say(told)
        return ()
    if session.has_control:
        choices = [Choice("", "Keep it"), Choice("release", "Release it: whoever may change it can", "r")]
    elif session.status.control is None:
        choices = [Choice("", "Leave it to all"), Choice("take", "Take it: users other than you change nothing", "t")]
    else:
        choices = [Choice("", "Leave it there"), Choice("force", "Take it: who has it is told", "F")]
    others = [name for name in operators(session.status) if name != name_of(session.identity)]
    body = f"{told}\n\n:control give NAME hands it over{f' ({and_more(others, 3)})' if others else ''}."
    answer = await context.app.push_screen_wait(Question(f"Who controls {session.name}?", body, choices))
    return (answer,) if answer else ()
