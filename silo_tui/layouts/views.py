"""Between the screens and a `KeptLayout`: `capture` takes it from them, `show` puts it on them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

import msgspec

from silo_tui.context import Context
from silo_tui.layouts.layout import KeptLayout
from silo_tui.modal import settled
from silo_tui.model.drawing.window import SPANS_S
from silo_tui.model.table.columns import BEFORE, TREE
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo_tui.screens.plots.monitor import MonitorScreen
    from silo_tui.screens.table import TableScreen

NORM = "norm"


def _table_of(context: Context) -> "TableScreen | None":
    return cast("TableScreen | None", context.screen_of("table"))


def capture(context: Context) -> KeptLayout | None:
    """Return what is on the screens of the logger that is open; None without one."""
    table, monitor = _table_of(context), cast("MonitorScreen | None", context.screen_of("monitor"))
    if table is None or not context.has_session or context.file_over_logger or not len(context.session.table):
        return None
    rows, short = context.session.rows, context.session.short_name
    layout = KeptLayout(
        rows.sort,
        rows.turned,
        rows.filter.text,
        table.table.chosen_columns,
        table.table.column_set,
        tuple(sorted(rows.folded)),
        tuple(sorted(short(name) for name in rows.unfolded)),
        _components_of(context.session),
        table.inspector_wanted,
        most=rows.most,
    )
    if monitor is None:
        return layout
    stack, window = monitor.stack, monitor.window
    held = {key: ends for key, ends in window.scales.items() if window.logs.isdisjoint(key.split("|"))}
    held |= {key: ends for key, ends in window.log_scales.items() if not window.logs.isdisjoint(key.split("|"))}
    return msgspec.structs.replace(
        layout,
        plots=tuple(tuple(short(plotted.name) for plotted in panel) for panel in stack.panels),
        chosen=short(stack.plots[stack.chosen].name) if stack.plots else "",
        span_s=window.span_s,
        scales={_of_parts(key, short): ends for key, ends in held.items() if window.fixed_scale and ends[0] < ends[1]},
        logs=tuple(sorted(short(plotted.name) for plotted in stack.plots if plotted.name in window.logs)),
    )


def _of_parts(key: str, named: Callable[[str], str]) -> str:
    """Return the key of a scale, the names of the signals that share it with `|` between them, by other names."""
    return "|".join(map(named, key.split("|")))


def _components_of(session: Session) -> dict[str, str]:
    """Return what is shown of vectors, in words: an entry's suffix, or their norm."""
    found = {}
    for name, chosen in sorted(session.rows.components.items()):
        row = session.table.row(name)
        if row is not None:
            entries = session.table.elements[row].entries
            found[session.short_name(name)] = NORM if chosen == 1 else entries[chosen - 2].suffix
    return found


def _show_rows(session: Session, layout: KeptLayout) -> None:
    """Fold, unfold, and choose entries of vectors; what this logger doesn't have is left out."""
    rows, table = session.rows, session.table
    by_short = {session.short_name(element.name): element for element in table.elements}
    by_short |= {element.name: element for element in table.elements}
    rows.folded = frozenset(layout.folded)
    rows.unfolded = {
        by_short[name].name: len(by_short[name].entries)
        for name in layout.unfolded
        if name in by_short and len(by_short[name].entries) > 1
    }
    rows.components = {}
    for name, word in layout.components.items():
        element = by_short.get(name)
        places = [NORM, *(entry.suffix for entry in element.entries)] if element is not None else []
        if element is not None and word in places and len(places) > 2:
            rows.components[element.name] = places.index(word) + 1


def show_table(table: "TableScreen", layout: KeptLayout) -> list[str]:
    """Show rows and columns as a view has them; return what of it isn't on this logger."""
    rows, missing = table.session.rows, []
    table.info.give_way()  # what was said is of other rows
    sort = BEFORE.get(layout.sort, layout.sort)
    if sort in rows.orders:
        rows.sort, rows.turned = sort, layout.turned and sort != TREE
    else:
        missing.append(f"order {layout.sort}")
    _show_rows(table.session, layout)
    rows.set_filter(layout.filter)
    if layout.most:
        rows.show_first(layout.most)
        rows.refresh()
    missing += [f"column {title}" for title in table.table.choose_columns(layout.columns)]
    table.inspector_wanted = layout.inspector
    if not table.show_set(layout.set):
        missing.append(f"set of columns {layout.set}")
    table.order_changed()
    return missing


def let_go_back(context: Context, before: KeptLayout | None) -> None:
    """Have Esc take a view back that was asked for: all that it changed in the table, and not its filter alone."""
    table = _table_of(context)
    if table is not None and before is not None:
        table.view_is_on(before.filter, before.sort, lambda: show_table(table, before))


async def show(context: Context, layout: KeptLayout) -> str:
    """Put a view on the screens; return what of it isn't on this logger, empty when all is."""
    table = _table_of(context)
    if table is None:
        return "no logger is open"
    session = context.session
    missing = show_table(table, layout)
    while context.app.screen is not table and len(context.app.screen_stack) > 1:
        await settled(context.app.pop_screen())
    entries = {
        session.short_name(element.name + entry.suffix): (element.name, element.name + entry.suffix)
        for element in (session.table.elements if layout.plots else ())
        for entry in element.entries
    }
    entries |= {name: (element, name) for element, name in entries.values()}  # whole names are taken too
    names = [name for panel in layout.plots for name in panel]
    gone = [name for name in names if name not in entries]
    if len(gone) < len(names):
        elements = list(dict.fromkeys(entries[name][0] for name in names if name in entries))
        from silo_tui.screens.plots.monitor import MonitorScreen

        monitor = MonitorScreen(session, elements)
        window, stack = monitor.window, monitor.stack
        plotted = {each.name: each for each in stack.plots}
        found = [[plotted.get(entries[name][1]) for name in panel if name in entries] for panel in layout.plots]
        panels = [tuple(each for each in panel if each is not None) for panel in found]
        stack.show_panels([panel for panel in panels if panel])
        window.span_s = min(SPANS_S, key=lambda span: abs(span - layout.span_s))
        window.logs |= {entries[name][1] for name in layout.logs if name in entries}
        for key, ends in layout.scales.items():
            if all(name in entries for name in key.split("|")):
                scales = window.scales if set(layout.logs).isdisjoint(key.split("|")) else window.log_scales
                scales[_of_parts(key, lambda name: entries[name][1])] = ends
        window.fixed_scale = bool(layout.scales)
        chosen = entries[layout.chosen][1] if layout.chosen in entries else ""
        stack.chosen = next((at for at, each in enumerate(stack.plots) if each.name == chosen), 0)
        if stack.plots:
            await context.app.push_screen(monitor)
    if gone:
        missing.append(f"{len(gone)} of {len(names)} plots ({', '.join(gone[:3])}{' …' if len(gone) > 3 else ''})")
    context.table_changed()  # last: what it may ask lies above what is shown now
    return "not on this logger: " + ", ".join(missing) if missing else ""
