"""What screens and dialogs have in common: their work ends before their widgets go."""

import asyncio
import math
import time
from collections.abc import Awaitable, Callable, Coroutine
from functools import cached_property, lru_cache, partial
from typing import Any, ParamSpec, TypeVar, cast

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.await_complete import AwaitComplete
from textual.color import Color
from textual.css.styles import RulesMap
from textual.dom import DOMNode
from textual.geometry import Region
from textual.renderables.background_screen import BackgroundScreen
from textual.screen import ModalScreen, Screen
from textual.strip import Strip
from textual.style import Style as ContentStyle
from textual.timer import Timer
from textual.visual import RenderOptions, Visual
from textual.widgets import OptionList

from silo_tui.unforeseen import Guarded

ResultT = TypeVar("ResultT")
Given = ParamSpec("Given")
Work = Callable[Given, Coroutine[Any, Any, object]]
BEHIND_S = 1.0  # what lies behind a dialog is drawn so often at the most: all of it each time, and keys wait


def run_aside(of: DOMNode, group: str, work: Work[Given], *given: Given.args, **named: Given.kwargs) -> None:
    """Do work in a worker of the app or of a screen, which ends with it.

    The coroutine is made when the worker begins: one that is handed over is left behind, and Python warns of it, where
    the worker is cancelled before it ran.
    """
    of.run_worker(cast("Callable[[], object]", partial(work, *given, **named)), group=group)


def run_alone(of: DOMNode, group: str, work: Work[Given], *given: Given.args, **named: Given.kwargs) -> None:
    """Do the same, and end what is still done of its group."""
    of.workers.cancel_group(of, group)
    run_aside(of, group, work, *given, **named)


async def settled(change: Awaitable[object]) -> None:
    """Wait until a screen has gone or come.

    The app waits for it, too: where who waits here is cancelled, Textual would have that cancel the change, and with it
    the app's own loop, through which no later key would come.
    """
    await asyncio.shield(change)


def ask(
    of: DOMNode,
    dialog: Screen[ResultT | None],
    then: Callable[[ResultT], object],
    left: Callable[[], object] = lambda: None,
) -> None:
    """Show a dialog, and go on with what it answers; where it was `left`, take back what was done for it."""

    def answered(answer: ResultT | None) -> None:
        if answer is None:
            left()
        else:
            then(answer)

    of.app.push_screen(dialog, answered)


class Leaving(Guarded, Screen[ResultT]):
    """A screen whose workers end before its widgets go: none of them wakes up to a screen without widgets."""

    _unmade = False
    _shone_s = -math.inf  # when it was drawn last, also behind a dialog

    @property
    def is_there(self) -> bool:
        """Whether the screen has its widgets: it was made, and neither it nor the program has begun to go."""
        return self.is_mounted and self.is_running and self.is_attached and not self._pruning

    @cached_property
    def _settling(self) -> dict[str, Timer]:
        return {}

    def once_settled(self, what: str, after_s: float, do: Callable[[], object]) -> None:
        """Do something when it was wished for no more since so long; `what` it is tells it from other wishes."""
        self.settle(what)
        self._settling[what] = self.set_timer(after_s, do)

    def settle(self, what: str) -> None:
        """Forget such a wish."""
        if what in self._settling:
            self._settling.pop(what).stop()

    async def on_event(self, event: events.Event) -> None:
        """Leave out what comes to a screen that gets no widgets: it, or the program, ends before they were made."""
        if isinstance(event, events.Mount):
            self._unmade = self._pruning or self.app._exit  # what it was made of has gone by now, or never comes
        told = isinstance(event, events.Callback) if self._unmade else self.is_attached or self.children
        if told or isinstance(event, events.Unmount):
            await super().on_event(event)

    def _compositor_refresh(self) -> None:
        if self.app._batch_count:  # Textual draws all of it, and then shows nothing
            self._repaint_required = True
        elif self.app.screen is not self and (wait_s := self._shone_s + BEHIND_S - time.monotonic()) > 0:
            self.once_settled("behind", wait_s, self._compositor_refresh)
        else:
            self._shone_s = time.monotonic()
            super()._compositor_refresh()

    async def _message_loop_exit(self) -> None:
        self.workers.cancel_node(self)  # Textual does it too, but when the widgets have gone
        await super()._message_loop_exit()


class Choices(Guarded, OptionList):
    """The choices of a dialog, which have the focus. Above the first is none: the last may be what loses most."""

    def action_cursor_up(self) -> None:
        """Go to the choice above."""
        if self.highlighted:
            super().action_cursor_up()

    def action_cursor_down(self) -> None:
        """Go to the choice below."""
        if self.highlighted is None or self.highlighted < self.option_count - 1:
            super().action_cursor_down()


@lru_cache(maxsize=4096)
def _tinted(style: Style | None, base: Style, tint: Color) -> Style:
    """Return a style as it shines through a dialog. Few styles make a screen, of thousands of pieces."""
    (piece,) = BackgroundScreen.process_segments([Segment(" ", style)], tint)
    return base + piece.style


class Behind(Visual):
    """The screen behind a dialog, as Textual draws it, which takes up to 0.1 s a time for it: it mixes colours anew for
    each piece of it, whenever a value changes there.
    """

    def __init__(self, screen: Screen[Any], tint: Color) -> None:
        self._screen, self._tint = screen, tint

    def get_optimal_width(self, rules: RulesMap, container_width: int) -> int:
        """Take all that there is."""
        return container_width

    def get_height(self, rules: RulesMap, width: int) -> int:
        """Be as high as the screen."""
        return self._screen.size.height

    def render_strips(self, width: int, height: int | None, style: ContentStyle, options: RenderOptions) -> list[Strip]:
        """Draw it."""
        base, tint = style.rich_style, self._tint
        return [
            Strip([Segment(words, _tinted(its, base, tint)) for words, its, _ in strip], strip.cell_length)
            for strip in self._screen._compositor.render_strips()
        ]


class Dialog(ModalScreen[ResultT], Leaving[ResultT]):  # in this order: Textual finds styles by the first base
    """A dialog, which is left once."""

    scope = ""  # that of a full screen; this is none
    waits = False  # whether it only stands for what is on its way, and keys wait for that
    loses = False  # whether an answer loses something
    asks = False  # whether it is a question: nothing typed is lost where it closes by itself
    drawn_s = math.inf

    def chosen_by(self, letter: str) -> str:
        """Return the words of what a letter alone chooses, after which this closes; empty for none."""
        return ""

    def may_lose(self, typed: events.Event) -> bool:
        """Whether what is typed may lose something: it is dropped where it was typed before this was drawn."""
        return self.loses

    def dismiss(self, result: ResultT | None = None) -> AwaitComplete:
        """Leave with a result; a second time does nothing, where Textual would close what lies below."""
        return super().dismiss(result) if self.is_active else AwaitComplete()

    def action_leave(self) -> None:
        """Leave; nothing is done."""
        self.dismiss(None)

    def render(self) -> Any:
        """Draw what is behind."""
        found = super().render()
        return Behind(found.screen, found.color) if isinstance(found, BackgroundScreen) else found

    def refresh(
        self, *regions: Region, repaint: bool = True, layout: bool = False, recompose: bool = False
    ) -> "Dialog[ResultT]":
        """Paint it again, and what shines through the dialogs below it: Textual keeps their pictures of what was."""
        if self.is_attached:
            for below in self.app._background_screens:
                if below.is_modal:
                    below._set_dirty(*regions)
        super().refresh(*regions, repaint=repaint, layout=layout, recompose=recompose)
        return self
