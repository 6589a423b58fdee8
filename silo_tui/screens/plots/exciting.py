"""`:excite`: a line that says how, a question, a dialog that any key ends; then how a signal answered to it."""

import threading
from typing import TYPE_CHECKING

from msgspec import structs
from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from silo.analysis.parameters import ToldExcitation
from silo.core.tuning.asked import EXAMPLE, read_excitation
from silo.core.tuning.excitation import ends_of, number_at
from silo.core.tuning.parameters import Excitation, ParameterInfo, range_text, value_text
from silo.errors import ElementError
from silo_tui.modal import Dialog
from silo_tui.screens.dialogs.questions import Prompt, confirmed
from silo_tui.screens.plots.responses import show_response

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.parameters.requests import ExcitationState
    from silo_tui.context import Context


class Exciting(Dialog[None]):
    """Stands while something is excited; any key ends it, and so does whatever closes the dialog."""

    KEYS_HERE = "Any key ends it"

    def __init__(self, name: str, what: Excitation) -> None:
        """Show how far it is."""
        super().__init__()
        self._name, self._what = name, what
        self.ended = threading.Event()

    def compose(self) -> ComposeResult:
        """Yield what goes on, and how far it is."""
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
        """End it."""
        event.stop()
        self.ended.set()
        for line in self.query("#how-far").results(Static):
            line.update("it goes back")

    def on_unmount(self) -> None:
        """End it with the program."""
        self.ended.set()


async def excite(context: "Context", name: str, line: str) -> None:
    """Ask how, where the line doesn't say it, and whether; then excite it, and say how it ended."""
    if not name:
        raise ElementError(f"say which parameter: :excite NAME {EXAMPLE}")
    knobs = context.session.knobs
    await knobs.refresh(context.link)
    info = named(knobs.known, name)

    def read(typed: str) -> Excitation:
        what = read_excitation(name, typed)
        ends_of(info, what)
        return what

    if not line:
        unit = "" if info.unit in ("", "-") else f" {info.unit}"
        body = f"It is {value_text(info.value, info.unit)}, and may be {range_text(info)}{unit}.\n"
        body += "Or multisine 0.1-20Hz, prbs 50Hz, step; also ramp 1s."
        typed = await context.app.push_screen_wait(Prompt(f"Excite {name}", body, _usual(info), EXAMPLE, read))
        if typed is None:
            return
        line = typed
    what = read(line)
    low, high = (number_at(end, what.index) for end in ends_of(info, what))
    around = value_text(number_at(info.value, what.index), info.unit)
    body = f"around {around}, from {low:g} to {high:g}:\n{what.text}\nIt comes back to {around}. Any key ends it."
    if not await confirmed(context.app, f"Excite {name}?", body, "Excite it", "Leave it"):
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
    bare = name.partition("[")[0]
    found = [info for full, info in known.items() if full == bare or full.endswith(f"/{bare.strip('/')}")]
    if len(found) != 1:
        there = ", ".join([*known][:5]) or "it has none"
        raise ElementError(f"{'several parameters are' if found else 'no parameter is'} '{bare}': {there}")
    return found[0]
