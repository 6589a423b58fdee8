"""The scope: each crossing of a level stands still on the screen, judged in the helper process on every sample.

Nothing is set up in the logger for it: the viewer asks for the crossings since the last one, and for the samples around
the newest. So a viewer that dies leaves nothing behind, and a crossing between two looks is counted, not missed.
"""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from textual.app import ComposeResult

from silo.core.conditions import new_trigger
from silo.core.elements import LoggedEvent
from silo.errors import RefusedError, SiloError
from silo.rpc.frames import Frame
from silo_tui.context import SiloScreen
from silo_tui.modal import ask, run_aside
from silo_tui.model.drawing.plots import Picture, Plotted
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots import scope as scopes
from silo_tui.model.plots.facts import extremes
from silo_tui.model.plots.time_axis import QUARTERS
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.words import text
from silo_tui.screens.dialogs.questions import Prompt
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.messages import MonitorLine
from silo_tui.widgets.plot_stack import PlotStack

LOOK_S = 0.2
MOST_CROSSINGS = 2000  # that are told of at a look: the newest of them is shown
LATE_PERIODS = 10


class _Caught:
    """The live source without what happened: times in a capture count from its crossing."""

    happened: Sequence[LoggedEvent] = ()
    live = False
    begin_ns = 0
    end_ns = 0

    def __init__(self, live: PlotSource) -> None:
        self.element, self.is_live = live.element, live.is_live
        self.history, self.samples = live.history, live.samples
        self._live = live

    def period_ns(self, element: str) -> int:
        """Return how long a value holds in the picture: a loop that is late by some ticks lost none."""
        return LATE_PERIODS * self._live.period_ns(element)


class ScopeStack(PlotStack):
    """One plot; its time counts from the crossing, its level is a line."""

    def __init__(self, plots: Sequence[Plotted], window: PlotWindow, source: PlotSource, scope: scopes.Scope) -> None:
        super().__init__(list(plots), window, source)
        self.show_panels([tuple(plots)])
        self.scope = scope

    def _axis_words(self) -> list[tuple[float, str]]:
        return [(share, scopes.axis_word(self.scope, share)) for share in QUARTERS]

    def _facts(self, at: int, plotted: Plotted) -> str:
        picture: Picture = self._panel(at).pictures[0]
        if picture.at_cursor is not None:
            return super()._facts(at, plotted)
        if np.isnan(picture.smallest):
            return ""
        smallest, largest = extremes(plotted, picture)
        return f"min {smallest}  max {largest}"

    def _short_fact(self, at: int, place: int) -> str:
        return super()._short_fact(at, place) if self._panel(at).pictures[place].at_cursor is not None else ""


class ScopeScreen(SiloScreen):
    """Waits for crossings of the first of some signals."""

    scope = "scope"

    def __init__(self, session: Session, plots: Sequence[Plotted], settings: scopes.Scope) -> None:
        super().__init__()
        self.session, self.live = session, session.source
        self.settings = settings
        self.window = PlotWindow(settings.span_s, 0, spans=scopes.SPANS)
        self.stack = ScopeStack(plots, self.window, _Caught(self.live), settings)
        self.stack.prefix = session.status.prefix.rstrip("/")
        self.stack.level = settings.level
        self.caught_ns = 0  # the crossing that is shown
        self.caught = 0  # how many
        self._samples: dict[str, Samples] = {}
        self._between = 0  # crossings that came between two looks
        self._since_ns = self.live.end_ns  # what came before is none of its business
        self._waits_since_s = time.monotonic()
        self._held = False
        self._forced = True  # what is there is shown until something is caught
        self._why = ""  # why it is blind
        self._looking = asyncio.Lock()
        self.line = MonitorLine(self.window, self._words, self._state)

    def compose(self) -> ComposeResult:
        yield from self.bars()
        yield self.stack
        yield self.line
        yield KeyBar()

    def on_mount(self) -> None:
        self._tell()
        self.set_interval(LOOK_S, self._look_again)

    # ------------------------------------------------------------------------------------------------------- looking

    @property
    def waits(self) -> bool:
        """Whether it waits for a crossing."""
        done = self.settings.mode is scopes.Mode.SINGLE and self.caught_ns > 0
        return not self._held and not done

    def _look_again(self) -> None:
        if (self.waits or self._forced) and not self._looking.locked() and self.session.connected:
            run_aside(self, "scope", self._look)

    async def _look(self) -> None:
        async with self._looking:
            settings, newest_ns = self.settings, self.live.end_ns
            try:
                at_ns, between = await self._newest_crossing(settings, newest_ns)
                late = settings.mode is scopes.Mode.AUTO and time.monotonic() - self._waits_since_s > scopes.AUTO_S
                free = at_ns is None and (self._forced or late)
                if free:
                    at_ns = newest_ns - settings.post_ns
                if at_ns is not None:
                    samples = await self._samples_around(settings, at_ns)
                    self._show(settings, samples, at_ns, between, crossing=not free)
                self._why = ""
            except SiloError as error:
                self._why = str(error) if isinstance(error, RefusedError) else "no link"
        self._tell()

    async def _newest_crossing(self, settings: scopes.Scope, newest_ns: int) -> tuple[int | None, int]:
        """Return the newest crossing that the whole picture of is there, and how many others came since the last."""
        link, name = self.session.link, self.stack.plots[0].name
        end_ns = newest_ns - settings.post_ns
        if link is None or end_ns <= self._since_ns:
            return None, 0
        # of the sample before the first one it is known on which side it was
        start_ns = self._since_ns - 2 * self.live.period_ns(self.stack.plots[0].element.name)
        found = await link.read(
            lambda client: client.find(
                [name], "crossing", settings.level, settings.direction, start_ns=start_ns, end_ns=end_ns,
                around_ns=end_ns, most=MOST_CROSSINGS,
            )
        )  # fmt: skip
        one = found[name]
        if one.why:
            raise RefusedError(f"{self.session.short_name(name)}: {one.why}")
        at_ns, between = scopes.newest_of(one.time_ns, self._since_ns)
        self._since_ns = max(self._since_ns, end_ns)
        return at_ns, between

    async def _samples_around(self, settings: scopes.Scope, at_ns: int) -> dict[str, Samples]:
        link, names = self.session.link, [plotted.name for plotted in self.stack.plots if plotted.numeric]
        if link is None:
            raise RefusedError("no logger is open")
        begin_ns, end_ns = at_ns - settings.pre_ns, at_ns + settings.post_ns + 1
        return await link.samples(names, begin_ns, end_ns)

    def _show(
        self, settings: scopes.Scope, samples: dict[str, Samples], at_ns: int, between: int, *, crossing: bool
    ) -> None:
        self._samples, self._forced = samples, False
        if crossing:
            self.caught, self._between, self.caught_ns = self.caught + 1 + between, between, at_ns
            self.line.say("")
            self._waits_since_s = time.monotonic()
        self._draw(at_ns)

    def _draw(self, at_ns: int | None = None) -> None:
        at_ns = self.caught_ns if at_ns is None else at_ns
        self.stack.scope = self.settings
        self.stack.level = self.settings.level
        self.window.span_s, self.window.paused_end_ns = self.settings.span_s, self.settings.post_ns
        if self._samples:
            self.stack.store = scopes.picture_of(self._samples, self.settings, at_ns, self.stack.columns)
        self.stack.redraw()

    # ----------------------------------------------------------------------------------------------------- what it says

    @property
    def state_word(self) -> str:
        """How it stands."""
        if self._why:
            return f"BLIND {self._why}"
        if self._held:
            return "HELD"
        if not self.caught_ns:
            return "AUTO no edge yet" if self.settings.mode is scopes.Mode.AUTO and self._samples else "ARMED"
        ago_s = max(0.0, (self.live.end_ns - self.caught_ns) / 1e9)
        if self.settings.mode is scopes.Mode.AUTO and time.monotonic() - self._waits_since_s > scopes.AUTO_S:
            return f"AUTO no edge for {text.span(round(time.monotonic() - self._waits_since_s))}"
        return f"CAUGHT {text.span(ago_s, 2)} ago"

    def _state(self) -> str:
        return "waiting" if self.waits else "standing still"

    def _words(self) -> Sequence[str]:
        words = [self.settings.words, f"{self.caught} caught"]
        if self._between:
            words.append(f"{self._between} more came between")
        return words if self.waits else [*words, "space goes on" if self._held else "space arms it again"]

    def _tell(self) -> None:
        self.status_bar.mode = f"SCOPE {self.settings.mode.value}  {self.state_word}"
        self.status_bar.update()
        self.line.refresh()

    def live_changed(self, frame: Frame) -> None:
        self._tell()

    def show_bars(self) -> None:
        super().show_bars()
        self._tell()

    def on_resize(self) -> None:
        self.call_after_refresh(self._draw)

    # -------------------------------------------------------------------------------------------------- commands

    def _set(self, settings: scopes.Scope, words: str) -> None:
        self.settings = settings
        self.say(words)
        self._waits_since_s = time.monotonic()
        self._draw()
        self._tell()

    def command_scope_mode(self) -> None:
        mode = scopes.NEXT[self.settings.mode]
        if mode is not scopes.Mode.SINGLE:
            self._held = False
        self._set(replace(self.settings, mode=mode), f"mode {mode.value}")

    def command_move_level(self, step: int) -> None:
        bottom, top = self.stack.scale_of_first()
        height = (top - bottom) if top > bottom else max(abs(self.settings.level), 1.0)
        level = float(text.short(self.settings.level + step * height / scopes.LEVEL_STEPS))
        self._set(replace(self.settings, level=level), "")

    def command_scope_settings(self) -> None:
        now = self.settings
        way = "rising" if now.direction > 0 else "falling"
        typed = f"{way} {text.short(now.level, 6)} pre {100 * now.pre:g} {now.mode.value}"
        body = "rising or falling, the level, pre and its share in %, normal, single or auto"
        prompt = Prompt(
            "Scope", body, typed, "e.g. rising 20 pre 40 normal", lambda line: scopes.parse_settings(line, now)
        )
        ask(self, prompt, lambda line: self._set(scopes.parse_settings(line, now), ""))

    def command_scope_force(self) -> None:
        self._forced = True
        self.say("what is there now")

    def command_scope_hold(self) -> None:
        if self.settings.mode is scopes.Mode.SINGLE and self.caught_ns and not self._held:
            self.caught_ns, self._since_ns = 0, self.live.end_ns
            self.say("armed again")
        else:
            self._held = not self._held
            self._since_ns = max(self._since_ns, self.live.end_ns) if not self._held else self._since_ns
            self.say("")
        self._waits_since_s = time.monotonic()
        self._tell()

    def command_zoom(self, closer: bool) -> None:
        self._set(replace(self.settings, span_s=scopes.other_span(self.settings.span_s, closer=closer)), "")

    def command_move_cursor(self, cells: int) -> None:
        self.window.move_cursor(cells, self.stack.columns)
        self.stack.redraw()

    def command_plot_trigger(self) -> None:
        from silo_tui.screens.dialogs.trigger_editor import ask_trigger

        name = self.session.short_name(self.stack.plots[0].name).lstrip("/")
        when = f"{name} {'>' if self.settings.direction > 0 else '<'} {text.short(self.settings.level, 6)}"
        around_s = self.settings.pre_ns / 1e9, self.settings.post_ns / 1e9
        made = new_trigger(name.rpartition("/")[2], when, *around_s)
        self.context.run_flow(ask_trigger(self.context, made))

    def command_back(self) -> None:
        """Leave the cursor, then the scope."""
        if self.window.cursor is not None:
            self.window.cursor = None
            self.stack.redraw()
        else:
            self.context.leave_screen()
