"""What is asked of many loggers at once: a question that names them all, then one answer from each.

The answers come into their lines as they are given; who is silent holds up no other. One such command at a time.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from rich.text import Text

from silo.core.quantities.writing import many
from silo.files.formats import savable
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.modal import run_aside
from silo_tui.model.lists import fleet
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.screens.dialogs.questions import Choice, Prompt, Question
from silo_tui.screens.lists.loggers import LoggersScreen
from silo_tui.sessions.finder import ClientFinder

if TYPE_CHECKING:
    from silo.client.bulk import Job, Outcome

    Asked = tuple[str, Sequence[FoundLogger], Job]  # what is done, of whom, and how

NO = Choice("", "No")


class Many:
    """Asks what is to become of loggers, and them."""

    def __init__(self, context: Context, finder: "Callable[[], ClientFinder]") -> None:
        self._context, self._finder = context, finder
        self._answers: dict[str, str] = {}
        self._counts: list[int] = [0, 0, 0]  # did, did not, are waited for
        self._verb = ""

    def begin(self, what: str, targets: Sequence[FoundLogger]) -> None:
        """Ask about them; what is said yes to is asked of each."""
        if self._counts[2]:
            self._context.say(f"{self._verb}: {self._counts[2]} have not answered yet")
            return
        run_aside(self._context.app, "many", self._ask, what, targets)

    async def _ask(self, what: str, targets: Sequence[FoundLogger]) -> None:
        now_ns = time.time_ns()
        body = Text("\n".join(fleet.asked_line(one, now_ns) for one in targets) + "\n")
        able = [one for one in targets if one.can_be_asked]
        if not able:
            self._context.say(fleet.why_none(targets, key_of("look_again")))
            return
        asks = {
            "start_stop": self._start_or_stop, "restart": self._restart, "save": self._save, "load": self._load,
        }  # fmt: skip
        if (answer := await asks[what](able, body)) is not None:
            self._carry_out(*answer)

    async def _put(self, title: str, body: Text, choices: Sequence[Choice]) -> str | None:
        answer: str | None = await self._context.app.push_screen_wait(Question(title, body, [NO, *choices]))
        return answer

    async def _start_or_stop(self, able: Sequence[FoundLogger], body: Text) -> "Asked | None":
        from silo.client.bulk import starting, stopping, stopping_and_saving

        running = [one for one in able if one.member.running]
        stopped = [one for one in able if not one.member.running]
        choices = []
        if running:
            count = many(len(running), "logger")
            choices += [Choice("stop", f"Stop {count}", "y"), Choice("stop save", f"Stop and save {count}", "s")]
        if stopped:
            count, unsaved = many(len(stopped), "logger"), any(map(fleet.is_unsaved, stopped))
            key = "y" if not running else "t"
            if unsaved:
                choices += [Choice("save", f"Save what isn't, and start {count}", "v" if running else "s"),
                            Choice("discard", f"Drop what isn't saved: start {count}", "D", loses=True)]  # fmt: skip
            else:
                choices.append(Choice("refuse", f"Start {count}", key))
        verb = "Stop" if not stopped else "Start" if not running else "Start or stop"
        answer = await self._put(f"{verb} {many(len(able), 'logger')}?", body, choices)
        if answer in ("stop", "stop save"):
            return "stop", running, stopping if answer == "stop" else stopping_and_saving
        return ("start", stopped, partial(starting, unsaved=answer)) if answer else None

    async def _restart(self, able: Sequence[FoundLogger], body: Text) -> "Asked | None":
        from silo.client.bulk import restarting

        count = many(len(able), "logger")
        choices = [Choice("save", f"Save, and restart {count}", "s"),
                   Choice("discard", f"Drop what isn't saved: restart {count}", "D", loses=True)]  # fmt: skip
        if not any(map(fleet.is_unsaved, able)):
            choices = [Choice("refuse", f"Restart {count}", "y")]
        answer = await self._put(f"Restart {count}?", body, choices)
        return ("restart", able, partial(restarting, unsaved=answer)) if answer else None

    async def _save(self, able: Sequence[FoundLogger], body: Text) -> "Asked | None":
        from silo.client.bulk import saving
        from silo.core.elements import FileType

        choices = [Choice("silo", "Save as .silo, each in its own folder", "y"),
                   Choice("all", f"Save as {savable()}", "a")]  # fmt: skip
        answer = await self._put(f"Save {many(len(able), 'logger')}?", body, choices)
        types = [FileType.SILO] if answer == "silo" else list(FileType)
        return ("save", able, partial(saving, types=types)) if answer else None

    async def _load(self, able: Sequence[FoundLogger], body: Text) -> "Asked | None":
        from silo.client.bulk import loading

        title = f"Load a script into {many(len(able), 'logger')}"
        words = f"{body.plain}The script of that name in each one's own folder; those that run refuse."
        name = await self._context.app.push_screen_wait(Prompt(title, words, "", "walk.yaml", label="name"))
        if not name:
            return None
        name = name if name.endswith((".yaml", ".yml")) else f"{name}.yaml"
        return "load", able, partial(loading, path=name)

    # ---------------------------------------------------------------------------------------------------- the answers

    def _carry_out(self, verb: str, chosen: Sequence[FoundLogger], job: "Job") -> None:
        self._verb, self._counts = verb, [0, 0, len(chosen)]
        self._answers = {one.key: "waiting for its answer" for one in chosen}
        self._show()
        loop = asyncio.get_running_loop()
        finder = self._finder()

        def collect() -> None:
            with suppress(RuntimeError):  # the program was ended meanwhile
                try:
                    for outcome in finder.ask_many(chosen, job):
                        loop.call_soon_threadsafe(self._take, chosen[outcome.place].key, outcome)
                finally:
                    loop.call_soon_threadsafe(self._end)

        run_aside(self._context.app, "many answers", asyncio.to_thread, collect)

    def _take(self, key: str, outcome: "Outcome") -> None:
        self._answers[key] = outcome.text if outcome.done else f"! {outcome.text}"
        self._counts[0 if outcome.done else 1] += 1
        self._counts[2] -= 1
        self._show()

    def _end(self) -> None:
        self._counts[2] = 0  # of whom there is no answer, there will be none

    def _show(self) -> None:
        done, failed, waiting = self._counts
        words = f"{self._verb}: {done} did, {failed} did not, {waiting} waiting"
        screen = self._context.upper_screen
        if isinstance(screen, LoggersScreen):
            screen.answers = self._answers
            screen.show()
        if isinstance(screen, LoggersScreen) or not waiting:
            self._context.say(words)
