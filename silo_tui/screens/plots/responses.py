"""How one signal answers to another: transfer function with coherence, or the answer to a step.

And `:excite`, which has it answer: a line that says how, a question, a dialog that any key ends.
"""

import asyncio
import threading
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING

from msgspec import structs
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from silo.analysis.parameters import ToldExcitation
from silo.analysis.responses import ResponseLog, bode_between, step_between
from silo.core.structs import alike
from silo.core.tuning.excitation import EXAMPLE, ends_of, number_at, read_excitation
from silo.core.tuning.parameters import Excitation, ParameterInfo, Wave, only_meant, range_text, value_text
from silo.errors import ElementError, SiloError
from silo_tui.context import Context, SiloScreen
from silo_tui.modal import Dialog, run_alone
from silo_tui.model.lists import responses
from silo_tui.model.lists.happened import of_last_run
from silo_tui.screens.dialogs.questions import Prompt, confirmed
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.parameters.requests import ExcitationState

USAGE = ":bode IN OUT FROM TO"
NOTES = 3  # lines below the charts
_DRAWING = threading.Lock()  # plotext has one picture for all threads


class ResponseScreen(SiloScreen):
    """Charts as `silo bode` and `silo step` draw them; Tab leads from one to the other."""

    scope = "response"

    def __init__(
        self, session: Session, asked: responses.Response, read: Callable[[], Awaitable[ResponseLog]], *, step: bool
    ) -> None:
        """`read` gives what is held of the two signals now."""
        super().__init__()
        self.session, self._asked, self._read, self.step = session, asked, read, step
        self._log: ResponseLog | None = None

    def compose(self) -> ComposeResult:
        yield from self.bars()
        yield Static("", id="detail-title", markup=False)
        yield Static("reading …", id="response", markup=False)
        yield Static("", id="response-said", markup=False)
        yield KeyBar()

    def on_mount(self) -> None:
        self.command_response_again()

    def on_resize(self, event: events.Resize) -> None:
        if self._log is not None:
            run_alone(self, "draw", self._draw)

    async def _draw(self, *, again: bool = False) -> None:
        asked = self._asked
        names = f"{self.session.short_name(asked.given.name)} to {self.session.short_name(asked.answer.name)}"
        of = f"   {asked.words}" if asked.words else ""
        self.query_one("#detail-title", Static).update(f"{'STEP' if self.step else 'BODE'}  {names}{of}")
        size = self.size.width, self.size.height - NOTES - 3
        try:
            if again or self._log is None:
                self._log = await self._read()
            drawn, said = await asyncio.to_thread(self._drawn, self._log, size)
        except (SiloError, OSError) as error:
            drawn, said = Text(f"\n{error}"), [f"{USAGE} looks at a part of it alone, in seconds"]
        self.query_one("#response", Static).update(drawn)
        self.query_one("#response-said", Static).update("\n".join(said[:NOTES]))

    def _drawn(self, log: ResponseLog, size: tuple[int, int]) -> tuple[Text, Sequence[str]]:
        """Return the charts, and what is said of them. In a thread: it may take half a second."""
        from silo.analysis.plots.drawing import draw_text
        from silo.analysis.plots.responses import bode_charts, step_chart, step_words

        given, answer = self._asked.given, self._asked.answer
        missing = log.missing if isinstance(log, responses.HeldResponse) else ""
        notes = [missing, responses.rate_words(log[given.name], self.session.status.frequency_hz)]
        if self.step:
            step = step_between(log, given.name, answer.name, *self._asked.window)
            units = [one.element.unit for one in (given, answer)]
            charts, said = [step_chart(step, "" if units[1] == "-" else units[1])], [*step_words(step, *units)]
        else:
            bode = bode_between(log, given.name, answer.name, *self._asked.window, None)
            charts, said = [*bode_charts(bode)], [responses.bode_words(bode)]
        width, height = size
        with _DRAWING:
            text = "\n".join(
                draw_text(chart, width, height // len(charts), color=not self.app.no_color) for chart in charts
            )
        return Text.from_ansi(text), [*said, *filter(None, notes)]

    # --------------------------------------------------------------------------------------------------- commands

    def command_response_mode(self) -> None:
        self.step = not self.step
        run_alone(self, "draw", self._draw)

    def command_response_again(self) -> None:
        run_alone(self, "draw", self._draw, again=True)

    def command_back(self) -> None:
        self.context.leave_screen()


async def show_response(
    context: Context, session: Session, words: Sequence[str], told: ToldExcitation | None = None
) -> None:
    """Show how a signal answers to another, `told` by which excitation, else by the last one.

    The words are input, output, from when and to when; it asks for an output where none is said. Raises ElementError.
    """
    if not words:
        raise ElementError(f"say which two signals: {USAGE}")
    given, answer = words[0], "".join(words[1:2])
    window = responses.typed_window(words[2:])
    elements, prefix = session.table.elements, session.status.prefix
    first = responses.named_signal(elements, prefix, given)
    if not answer:
        body = "The signal that answers to it; :bode IN OUT shows it later."
        if told is not None:
            body = f"{told.ended or 'it goes back'}, rows {told.tick} to {told.until}.\n{body} Esc: none."
        typed = await context.app.push_screen_wait(
            Prompt(
                f"How does which signal answer to {session.short_name(first.name)}?", body, "", "joints/q_3",
                lambda line: responses.named_signal(elements, prefix, line),
            )
        )  # fmt: skip
        if typed is None:
            return
        answer = typed
    told = told or responses.last_told(of_last_run(session.happened), first)
    asked = responses.Response(
        first, responses.named_signal(elements, prefix, answer), told, session.status.started_ns, window
    )

    async def read() -> ResponseLog:
        return await _read(session, asked)

    step = told is not None and told.what.wave is Wave.STEP
    await context.app.push_screen(ResponseScreen(session, asked, read, step=step))


async def _read(session: Session, asked: responses.Response) -> ResponseLog:
    from silo.analysis.log import Log
    from silo_tui.sessions.recorded import FileSession

    if isinstance(session, FileSession):
        return Log(session.source.recording)
    if session.status.started_ns != asked.began_ns:
        raise ElementError("the logger was started anew since: what it held before is gone")
    names, (start, end) = (asked.given.name, asked.answer.name), asked.ticks

    def job(client: "Client") -> list[responses.HeldSamples]:
        found = client.samples(list(dict.fromkeys(names)), start, end, by="tick")
        return [alike(responses.HeldSamples, found[name]) for name in names]

    return responses.HeldResponse(asked, *await session.connection.aside(job))


class Exciting(Dialog[None]):
    """Stands while something is excited; any key ends it, and so does whatever closes the dialog."""

    KEYS_HERE = "Any key ends it"

    def __init__(self, name: str, what: Excitation) -> None:
        """Show how far it is."""
        super().__init__()
        self._name, self._what = name, what
        self.ended = threading.Event()

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog"):
            yield Static(f"{self._name} is excited: any key ends it", classes="dialog-title", markup=False)
            yield Static(self._what.text, markup=False)
            yield Static("", id="how-far", markup=False)

    def wait(self, state: "ExcitationState", seconds: float) -> bool:
        """Show how far it is, and wait; True once it is to end. In the thread of the client."""
        if not self.ended.is_set() and self.is_running:
            self.app.call_later(self._show, state.at_s)
        return self.ended.wait(seconds)

    def _show(self, at_s: float) -> None:
        for line in self.query("#how-far").results(Static):
            line.update(f"{at_s:.1f} of {self._what.duration_s:g} s")

    def on_key(self, event: events.Key) -> None:
        event.stop()
        self.ended.set()
        for line in self.query("#how-far").results(Static):
            line.update("it goes back")

    def on_unmount(self) -> None:
        self.ended.set()


async def excite(context: Context, name: str, line: str) -> None:
    """Ask how, where the line doesn't say it, and whether; then excite it, and say how it ended."""
    if not name:
        raise ElementError(f"say which parameter: :excite NAME {EXAMPLE}")
    knobs = context.session.knobs
    await knobs.refresh(context.link)
    info, shown = named(knobs.known, name), context.shown(name)

    def read(typed: str) -> Excitation:
        what = read_excitation(name, typed)
        ends_of(info, what)
        return what

    if not line:
        unit = "" if info.unit in ("", "-") else f" {info.unit}"
        body = f"It is {value_text(info.value, info.unit)}, and may be {range_text(info)}{unit}.\n"
        body += "Or multisine 0.1-20Hz, prbs 50Hz, step; also ramp 1s."
        typed = await context.app.push_screen_wait(Prompt(f"Excite {shown}", body, _usual(info), EXAMPLE, read))
        if typed is None:
            return
        line = typed
    what = read(line)
    low, high = (number_at(end, what.index) for end in ends_of(info, what))
    around = value_text(number_at(info.value, what.index), info.unit)
    body = f"around {around}, from {low:g} to {high:g}:\n{what.text}\nIt comes back to {around}. Any key ends it."
    if not await confirmed(context.app, f"Excite {shown}?", body, "Excite it", "Leave it"):
        return
    dialog = Exciting(name, what)
    context.app.push_screen(dialog)

    def job(client: "Client") -> "ExcitationState":
        return client.parameters.excite(
            name, what.wave, amplitude=what.amplitude, duration=what.duration_s, low_hz=what.low_hz,
            high_hz=what.high_hz, ramp=what.ramp_s, wait=dialog.wait,
        )  # fmt: skip

    try:
        ended = await context.link.aside(job)
    finally:
        dialog.ended.set()
        dialog.dismiss()
    full = f"{info.name}_{what.index}" if isinstance(info.value, tuple) else info.name
    said = f"{name}: {ended.ended or 'it goes back'}, rows {ended.tick} to {ended.until}"
    context.say(f"{said}; :bode {name} SIGNAL")
    if 0 <= ended.tick < ended.until:
        told = ToldExcitation(structs.replace(what, name=info.name), ended.tick, ended.until, ended.ended)
        try:
            await show_response(context, context.session, [full], told)
        except ElementError as error:
            context.say(f"{said}; {error}")


def _usual(info: ParameterInfo) -> str:
    """A line to begin with: a tenth of the range, which fits in most places."""
    if info.minimum is None or info.maximum is None:
        return ""
    amplitude = (info.maximum - info.minimum) / 10
    if info.step:
        amplitude = max(info.step, round(amplitude / info.step) * info.step)
    return EXAMPLE.replace("amplitude 2", f"amplitude {amplitude:g}")


def named(known: dict[str, ParameterInfo], name: str) -> ParameterInfo:
    """Return the parameter that a name means, without the number of a value. Raises ElementError."""
    return known[only_meant(name.partition("[")[0], known)]
