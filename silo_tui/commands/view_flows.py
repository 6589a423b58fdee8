"""What takes several steps with views: putting one on the screen, listing them, having the robot keep one."""

import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import msgspec

from silo.errors import RefusedError, SiloError
from silo_tui.commands import flows
from silo_tui.context import Context
from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.layouts.presets import BY_NAME, NEAR, near_limit
from silo_tui.screens.dialogs.questions import Choice

if TYPE_CHECKING:
    from silo.client.client import Client

LAST = "last"  # the view of what was on the screen when it was left, unless there is one of that name
ROBOT = "robot:"  # in front of the name of a view that the robot keeps


async def open_view(context: Context, name: str) -> None:
    """Put a view on the screen; say what of it isn't there. RefusedError where there is none of that name."""
    before = views.capture(context)
    told = await view_shown(context, name)
    views.let_go_back(context, before)
    context.say(told)


async def view_left(context: Context, left: files.LeftLayout) -> str:
    """Put on the screen what was left; return what is to be said of it, as nobody typed its filter today."""
    missing = await views.show(context, left.layout)
    return "; ".join(filter(None, [f"this is what was on the screen {left.since}", missing, *left.problems[:1]]))


async def view_shown(context: Context, name: str) -> str:
    """Put a view on the screen; return what is to be said of it. RefusedError where there is none of that name.

    `robot:NAME` is one that the robot keeps, whose name alone will do where no other has it; only then it is asked.
    """
    kept = files.names()
    is_here = name.startswith(ROBOT) or name in {LAST, *BY_NAME, *kept}
    if not is_here and ROBOT + name in await kept_names(context):
        name = ROBOT + name
    preset = BY_NAME.get(name) if name not in kept else None
    problems: list[str] = []
    try:
        if name == LAST and LAST not in kept and context.left_view is not None:
            return await view_left(context, context.left_view)
        if preset is not None and name == NEAR:
            await context.session.refresh_conditions()
            return await _near_limit_shown(context)
        if preset is not None:
            layout = preset.layout
            if preset.shown and context.has_session:
                context.session.filter_words[layout.filter] = preset.shown
        elif name.startswith(ROBOT):
            from silo_tui.layouts.texts import read

            plain = name.removeprefix(ROBOT)
            layout, problems = read((await context.link.read(lambda client: client._kept_view(plain))).text)
        else:
            layout, problems = files.load(name)
    except ValueError as error:
        raise RefusedError(str(error)) from error
    missing = await views.show(context, layout)
    meant = f": {preset.words.partition(': ')[2]}" if preset is not None else ""
    return "; ".join(filter(None, [f"view {name}{meant}", missing, *problems[:1]]))


async def _near_limit_shown(context: Context) -> str:
    """Filter for what is near a limit, the nearest on top, in the columns that are shown; leave the table where nothing
    is.
    """
    session, key = context.session, context.key_in_table("limits_of_row")
    if not session.limits:
        return f"no signal has limits: {key} sets some"
    passing, words = near_limit(session.limits)
    session.near, session.near_ns = passing, time.time_ns()
    if not passing:
        return f"{words}; {context.key_in_table('alarms')} lists them, {key} sets more"
    shown = views.capture(context) or KeptLayout()
    sort = BY_NAME[NEAR].layout.sort
    await views.show(context, msgspec.structs.replace(shown, sort=sort, turned=False, filter=passing, plots=(), most=0))
    return words


async def robots_names(context: Context) -> list[str]:
    """Return the names of the views that the robot keeps."""
    return [ROBOT + name for name in (await context.link.read(lambda client: client._kept_views())).names]


async def kept_names(context: Context) -> list[str]:
    """Return the names of the views that were kept, here and on the robot."""
    known = files.names()
    with suppress(SiloError):  # no link: those of this machine are there all the same
        known += await robots_names(context)
    return known


def numbered(names: Sequence[str]) -> list[Choice]:
    """Return views as choices, the first nine by their digit."""
    return [Choice(name, f"View {name}", str(at) if at < 10 else "") for at, name in enumerate(names, 1)]


async def tell_views(context: Context) -> None:
    """Say which views there are, here and on the robot."""
    known = await kept_names(context)
    none = "no views yet; `:view save NAME` makes one, `:view save robot:NAME` one for all who look at this robot"
    own = f"views: {', '.join(known)}" if known else none
    context.say(f"{own}; always there: {', '.join(BY_NAME)}")


async def keep_view(context: Context, name: str, layout: KeptLayout) -> None:
    """Have the robot keep a view; where it has one of that name, ask first."""
    from silo_tui.layouts.texts import write

    def keep(client: "Client", again: bool) -> str:
        return client._keep_view(name, write(layout), overwrite=again)

    said = await flows.keep_on_robot(context, f"Write over view {name}?", "Write", keep)
    if said is not None:
        context.say(f"{said}: `:view {ROBOT}{name}` opens it, or silo-tui --view {ROBOT}{name}")
