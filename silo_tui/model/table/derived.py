"""A signal that is derived from others, while it is typed: what it would be, or what is wrong with it. Pure."""

from collections.abc import Sequence

from silo.core.conditions import Conditions, Derived
from silo.core.elements import ElementInfo, join_name
from silo.core.quantities.writing import many, ordinal
from silo.errors import ElementError
from silo.expressions.derived_signals import derived_infos
from silo.judging.checks import table_catalogue, with_derived
from silo_tui.model.table.state import TableState

UNNAMED = "it stands in tables, plots and files"  # what it has a name for


def present(table: TableState) -> tuple[Derived, ...]:
    """Return the derived signals of a table; those whose unit follows from their signals have none of their own."""
    own, found = table.elements[: table.own], list[Derived]()
    for info in table.elements[table.own :]:
        plain = Derived(info.name, info.expression)
        made = derived_infos(own, table.prefix, (*found, plain))
        follows = bool(made) and made[-1].name == info.name and made[-1].unit == info.unit
        found.append(plain if follows else Derived(info.name, info.expression, info.unit))
    return tuple(found)


def named(table: TableState, name: str) -> Derived:
    """Return the derived signal of that name, with or without prefix; a new one where there is none yet."""
    whole = join_name(table.prefix, "", name)
    return next((one for one in present(table) if one.name in (whole, name)), Derived(name, ""))


def words_of(one: Derived, table: TableState) -> list[str]:
    """Return what a derived signal would be: how many values, in what, how often; and what is off of it.

    Raises ElementError for what can't be derived, with the place in the expression.
    """
    if not one.name.strip("/ "):
        raise ElementError(f"name it before Enter: {UNNAMED}")
    whole = Derived(join_name(table.prefix, "", one.name), one.expression, one.unit)
    own = table.elements[: table.own]
    conditions = with_derived(Conditions(present(table)), whole, table_catalogue(own, table.prefix))
    info = next(info for info in derived_infos(own, table.prefix, conditions.derived) if info.name == whole.name)
    return [_kind(info), *_users(whole.name, conditions.derived, table)]


def _kind(info: ElementInfo) -> str:
    values = "one number" if not info.shape else many(len(info.entries), "number")
    unit = "no unit" if info.unit == "-" else f"in {info.unit}"
    every = "every tick" if info.options.divider == 1 else f"every {ordinal(info.options.divider)} tick"
    off = "" if info.options.enabled else info.description.rpartition(" (")[2].rstrip(")")
    return f"{values}, {unit}, {every}" + (f"; {off}" if off else "")


def _users(name: str, derived: Sequence[Derived], table: TableState) -> list[str]:
    """Return a line on what is computed from it already."""
    place = next(at for at, one in enumerate(derived) if one.name == name)
    own = table.elements[: table.own]
    without = derived_infos(own, table.prefix, [*derived[:place], *derived[place + 1 :]])
    before = {info.name: info.options.enabled for info in table.elements[table.own :]}
    users = [info.name for info in without if before.get(info.name) and not info.options.enabled]
    return [f"changes {', '.join(table.shown(user) for user in users)} too"] if users else []
