"""Edit one trigger: lines for what it says, and below them what it would have done in all that is held."""

from collections.abc import Awaitable, Callable
from typing import ClassVar

from silo.core.conditions import TriggerOptions
from silo.errors import ElementError
from silo.files.formats import SAVED_NAMES
from silo.judging.checks import as_held, check_held
from silo.judging.triggers import SLACK_S
from silo_tui.context import Context
from silo_tui.model.lists import conditions
from silo_tui.model.words import text
from silo_tui.screens.dialogs.form import CONDITION, Form, taken, told
from silo_tui.sessions.live import Session

LINES = (("name",), ("when",), ("rearm", "mode"), ("pre", "post"), ("persist", "holdoff"), ("save", "keep"))
HINTS = {
    "name": "a word for names of files", "when": "e.g. abs({0}) > 0.6 and {1} < 20",
    "rearm": "once 'when' was false", "pre": "0", "post": "0", "persist": "0", "holdoff": "0",
    "mode": "normal rising", "save": SAVED_NAMES[0], "keep": "newest so many, 0 all",
}  # fmt: skip


async def ask_trigger(
    context: Context, made: TriggerOptions, send: Callable[[TriggerOptions], Awaitable[None]] | None = None
) -> None:
    """Let a new trigger be edited, and set it."""
    session = context.session
    held = as_held(made, session.table.elements, session.status.frequency_hz)

    def form(one: TriggerOptions | None, problem: str) -> TriggerEditor:
        return TriggerEditor(session, one or held, is_new=True, problem=problem, wanted_s=made.pre_s)

    async def set_it(answer: TriggerOptions) -> None:
        if send is not None:
            await send(answer)
        else:
            await told(context, lambda client: client._set_trigger(answer), "triggers")
        session.made_trigger = answer.name

    await taken(context, form, set_it)


class TriggerEditor(Form[TriggerOptions]):
    """Answers with the trigger on Enter."""

    KEYS_HERE = "Enter Sets it  Tab Next field  → Edits what stands there  Esc Back"
    NAMING = ("when", "rearm")
    AFTER_S = 0.5
    NEEDED: ClassVar = {"name": conditions.UNNAMED, "when": CONDITION}
    ABOUT: ClassVar = {
        "name": "stands in names of its files: letters and digits",
        "when": "it fires as this turns true (see mode): signals, numbers with units, and or not",
        "rearm": "after it fired it waits until this is true once; empty: until 'when' was false",
        "mode": "normal each time, single once; then its edge: rising, falling, level",
        "pre": f"so much before the moment is in the file: buffers must hold it, and {SLACK_S:g} s more to judge it",
        "post": "so much after the moment is in the file: 2 is 2 s",
        "persist": "'when' must be true for so long before it fires: 0 at once",
        "holdoff": "after it fired nothing fires for so long: 0 at once again",
        "save": f"files of a capture: {', '.join(SAVED_NAMES)}, or {conditions.NO_FILES}",
        "keep": "so many of the newest captures stay, older ones are deleted: 0 keeps all",
    }

    def __init__(
        self, session: Session, options: TriggerOptions, *, is_new: bool, problem: str = "", wanted_s: float = 0.0
    ) -> None:
        """`wanted_s` is the pre that it would begin with if the buffers held so much."""
        where = f"on {session.name}"
        title = f"New trigger {where}" if is_new else f"Trigger {options.name} {where}"
        super().__init__(
            title,
            LINES,
            conditions.fields_of(options),
            HINTS,
            problem,
            "when" if options.name else "name",
            session.table,
        )
        self._session = session
        self._options, self._wanted_s = options, wanted_s
        if is_new:  # also on another row, as who mends there why it was refused
            self.about = (title, "")

    async def look(self) -> str:
        fields = self.fields
        unnamed = not fields["name"]  # the condition counts while there is no name yet
        made = conditions.options_of_fields({**fields, "name": "new"} if unnamed else fields, self._options)
        if not made.when:
            return "\n".join([CONDITION, *self._shorter(made)])
        tried = await self._session.tried(made)
        loop = self._session
        slow = conditions.slow_words(made, loop.rate_hz, loop.status.frequency_hz)
        return "\n".join(
            [
                *conditions.tried_lines(tried, self.told_width),
                conditions.capture_words(tried, made),
                *([slow] if slow else []),
                *(self._too_short(made) or self._shorter(made)),
                *([f"name it before Enter: {conditions.UNNAMED}"] if unnamed else []),
            ]
        )

    def _shorter(self, made: TriggerOptions) -> list[str]:
        """Return that pre is as long as the buffers allow, where it would begin with more."""
        if made.pre_s != self._options.pre_s or made.pre_s >= self._wanted_s:
            return []
        return [f"pre is {text.span(made.pre_s)}, not {text.span(self._wanted_s)}: all that the buffers hold"]

    def _too_short(self, made: TriggerOptions) -> list[str]:
        """Return why the robot would refuse it, as its buffers are now."""
        try:
            check_held(made, self._session.table.elements, self._session.status.frequency_hz)
        except ElementError as error:
            return [f"Enter is refused: {error}"]
        return []

    def made(self) -> TriggerOptions:
        return conditions.options_of_fields(self.fields, self._options)
