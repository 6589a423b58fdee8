"""Derived signals from the terminal: the lines that make or change one, and the question before one is forgotten."""

from collections.abc import Sequence
from typing import ClassVar

from msgspec.structs import replace

from silo.core.conditions import Derived
from silo.core.quantities.writing import many
from silo_tui.context import Context
from silo_tui.model.table import derived
from silo_tui.screens.dialogs.form import NUMBER, Form, taken
from silo_tui.screens.dialogs.questions import confirmed
from silo_tui.sessions.live import Session

LINES = (("name",), ("is",), ("unit",))
HINTS = {"name": "e.g. power", "unit": "else as it follows", "is": "e.g. {0} * {1}"}


class DeriveDialog(Form[Derived]):
    """Answers with the derived signal on Enter."""

    KEYS_HERE = "Enter Derives it  Tab Next field  → Edits what stands there  Esc Back"
    NAMING = ("is",)
    EXPRESSION = "is"
    NEEDED: ClassVar = {"name": derived.UNNAMED, "is": NUMBER}
    ABOUT: ClassVar = {
        "name": "a row of the table, a topic and a column of files is called so",
        "unit": "shown beside its values: 'kW' or '1'; empty: as it follows from those of its signals",
        "is": "each tick, of names or their ends: + - * /, norm() rate() diff() abs() mean(x, 1s) a > b",
    }

    def __init__(self, session: Session, one: Derived, *, is_new: bool, problem: str = "") -> None:
        name = session.short_name(one.name).lstrip("/")
        title = f"Derive a signal on {session.name}" if is_new else f"Derived signal {name} on {session.name}"
        values = {"name": name, "unit": one.unit, "is": one.expression}
        super().__init__(title, LINES, values, HINTS, problem, "is" if name else "name", session.table)
        self._session = session

    def made(self) -> Derived:
        derived.words_of(self._typed, self._session.table)
        return self._typed

    @property
    def _typed(self) -> Derived:
        return Derived(self.fields["name"], self.fields["is"], self.fields["unit"])

    async def look(self) -> str:
        typed = self._typed
        if not typed.expression:
            return NUMBER
        if typed.name.strip("/ "):
            return "\n".join(derived.words_of(typed, self._session.table))
        words = derived.words_of(replace(typed, name="unnamed"), self._session.table)
        return f"{words[0]}; name it before Enter"


async def ask_derived(context: Context, session: Session, one: Derived, *, is_whole: bool) -> None:
    """Ask what is to be derived, where that isn't said as a whole, have it derived, and go to its row."""
    is_new = not any(known.name == one.name for known in derived.present(session.table))

    def form(made: Derived | None, problem: str) -> DeriveDialog:
        return DeriveDialog(session, made or one, is_new=is_new, problem=problem)

    async def send(made: Derived) -> None:
        said = await context.link.call(lambda client: client.derive(made.name, made.expression, made.unit))
        await session.reload()
        row = session.table.row(derived.named(session.table, made.name).name)
        if row is not None and not session.rows.move_to_row(row):
            said += "; the filter hides it: Esc shows all"
        context.say(said)

    await taken(context, form, send, one if is_whole else None)


async def forget(context: Context, session: Session, rows: Sequence[int]) -> None:
    """Ask, and forget derived signals."""
    names = [session.table.names[row] for row in rows]
    shown = [session.short_name(name) for name in names]
    one = len(names) == 1
    what = shown[0] if one else many(len(names), "derived signal")
    lines = [f"{name} {session.table.elements[row].description}" for name, row in zip(shown, rows, strict=True)]
    lines += ["Its signals stay as they are." if one else "Their signals stay as they are."]
    title, keep = f"Delete {what} of {session.name}?", f"Keep {'it' if one else 'them'}"
    if not await confirmed(context.app, title, "\n".join(lines), "Delete", keep):
        return
    said = await context.link.call(lambda client: "; ".join([client._remove_derived(name) for name in names[::-1]]))
    await session.reload()
    context.say(said)
