"""The monitor: the commands of a plot screen."""

from collections.abc import Callable, Sequence
from typing import Any, cast

from silo.core.quantities.writing import and_more
from silo_tui.actions import Command, key_of
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.drawing.plots import Plotted, plots_of
from silo_tui.model.plots.panels import Panel, gathered, has_curves, isolate, join, sides, stacked
from silo_tui.model.plots.scope import Scope, fitting_span, halfway
from silo_tui.model.words import text
from silo_tui.model.words.command_line import BY_KEY, WHAT_TO_PLOT, Spelled
from silo_tui.model.words.names import fitted_among
from silo_tui.screens.dialogs.exporting import ask_export
from silo_tui.screens.plots.plot_screen import PlotScreen
from silo_tui.screens.plots.searching import MomentSearch, value_here
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import left_a_file
from silo_tui.widgets.plot_stack import PlotStack

ONE_VALUE = "no vector: one value"
OF_PLOTS = {
    "all_entries", "arrange_plots", "catch", "isolate_plot", "join_plots", "log_axis", "mode_xy", "next_entry",
    "plot_trigger", "turn_plotted_up",
}  # fmt: skip

JOINED_NAME = 10  # cells of a name in the menu
ROOMY = 110  # cells in which keys have longer words
TO_BEFORE = ("earlier", "cursor_left")
OF_LATER = ("later", "newest")
OF_WHAT_GOES_ON = {"all_entries": "plots them", "next_entry": "goes on to it"}


def added_words(names: Sequence[str]) -> str:
    """Return which signals were plotted by what was typed, and how many, where it meant several."""
    return f"added {names[0]}" if len(names) == 1 else f"added {len(names)} plots: {and_more(names, 3)}"


class MonitorScreen(PlotScreen):
    """Plots of the elements that were marked when it was opened; of a file cursor A is a moment, whatever the zoom."""

    scope = "monitor"
    PARTS = (MomentSearch,)
    came_with_file = False  # whether one key opened a file and these plots of it: one leaves both
    came_at_moment = False  # whether one key opened these plots and held them at a moment: one leaves both

    def __init__(self, session: Session, names: Sequence[str], chosen: str = "") -> None:
        super().__init__(session, names, chosen)
        self.search = MomentSearch(self)
        self.parts = (self.search,)

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Do what a key asks for; of a dead robot that left a file, Enter opens that, with the same plots."""
        if command_id == "detail" and left_a_file(self.session):
            self.open_left(list(dict.fromkeys(plotted.element.name for plotted in self.stack.plots)))
            return
        super().action_command(command_id, typed)

    def command_zoom(self, closer: bool) -> None:
        """Zoom around the cursor while the picture stands still, or around its middle; live at its right end."""
        if not self.window.paused:
            done = self.window.zoom(closer=closer)
        elif done := self.window.zoom_still(self.held_ns, self.stack.columns, closer=closer):
            self.moved(elsewhere=False)
        if done:
            self.line.say("")
            self.request_view()
        else:
            whole = "longest span" if self.file is None else "whole file"
            self.say(f"that is the {'shortest span' if closer else whole}")

    def command_move_cursor(self, cells: int) -> None:
        if not self.window.paused:
            self.window.move_cursor(cells, self.stack.columns)
            self.stack.redraw()
            self.line.refresh()
            return
        self.line.say("")
        at_ns = self.window.at_ns
        step_ns = 2 * cells * self.window.column_ns(self.stack.columns)
        if self.window.cursor is None or at_ns is None:  # it is elsewhere: it comes in from the side it moves away from
            self._go_to(self.shown_ns[1 if cells < 0 else 0] + step_ns)
        else:
            self._go_to(at_ns + step_ns)

    def command_turn_plotted(self, steps: int) -> None:
        run_aside(self, "turning", self._turn, steps)

    async def _turn(self, steps: int) -> None:
        """Turn the parameter whose plot is chosen."""
        if self._refused("turn_plotted_up"):
            return
        plotted, knobs = self.stack.chosen_plot, self.session.knobs
        with self.context.telling(tell=self.say):
            if plotted.element.name not in knobs.known:
                await knobs.refresh(self.context.link)
            if words := await knobs.turn(self.context.link, plotted.element.name, steps):
                self.say(words)

    def command_pan(self, direction: int) -> None:
        """Pan by half a window; the cursor stays where it is in the picture."""
        span_ns, (oldest_ns, newest_ns) = self.window.span_ns, self.held_ns
        if direction > 0 and not self.window.paused:
            self.say("that is now")
            return
        is_unknown = self.pause.possible and self.pause.source is None  # what lies behind the oldest
        column_ns = self.window.column_ns(self.stack.columns)
        if direction < 0 and is_unknown and oldest_ns + span_ns >= self.end_ns - column_ns:
            run_alone(self, "behind", self._look_behind)
            return
        if not self.window.paused:
            self.stand_still()
            self.paused_alone = True
        if self._looking_back and self.end_ns + direction * span_ns // 2 >= newest_ns:
            self.go_on()
            return
        end_ns = self.end_ns
        moved = self.window.pan(direction, (oldest_ns, newest_ns), self.stack.columns)
        by_ns = abs(self.end_ns - end_ns)
        self.moved()
        whole = newest_ns - oldest_ns <= span_ns  # then there is nothing to go back in
        far = key_of("cursor_far_left" if direction < 0 else "cursor_far_right")
        edge, cursor = self._edge(direction), f"{far} cursor by ten"
        reaches = (
            f"that is {edge}: all is shown; {key_of('closer')} closer, " if whole else f"what is shown reaches {edge}; "
        )
        short = f"{text.span(by_ns / 1e9, 2)} {'on' if direction > 0 else 'back'}: " if moved else ""
        at_edge = not moved or by_ns < span_ns // 2 - column_ns
        limited = self.pause.why_no_more(self.stack.plots) if direction < 0 and self.pause.possible else ""
        if at_edge and limited:
            ways = f"{self.context.key_in_table('edit_size')} holds more, :record records, "
            self.say(f"{short}that is the oldest: {limited}; {ways}{key_of('recordings')} has what is saved")
        else:
            self.say(f"{short}{reaches}{cursor}" if at_edge else "")

    async def _look_behind(self) -> None:
        """Hold all that the buffers have, which tells how much that is, and go back in it."""
        self.hold()
        await self.pause.settled()
        if self.pause.source is not None:
            self.command_pan(-1)

    def _edge(self, direction: int) -> str:
        if self.file is not None:
            return f"the {'end' if direction > 0 else 'beginning'} of the file"
        return "where it was paused" if direction > 0 else "the oldest that is held"

    def command_oldest(self) -> None:
        self.stand_still()
        self._go_to(self.held_ns[0])

    def command_newest(self) -> None:
        if self._looking_back:
            self.go_on()
        elif self.window.paused:
            self._go_to(self.held_ns[1])

    def command_all_held(self) -> None:
        held = self.held_ns
        self.window.fit(held)
        if self.window.paused:
            self.window.show(held[1], held, self.stack.columns)
            self.moved(elsewhere=False)
        self.request_view()
        self.say("")

    # ------------------------------------------------------------------------------------------------ two cursors

    def command_cursor_b(self) -> None:
        self.pause_here()
        if self.window.other_ns is not None:
            self.window.other_ns = None
            self.say("cursor B is lifted")
        else:
            if self.window.at_ns is None:
                self.window.at_ns = self.end_ns - self.window.span_ns // 2
            self.window.other_ns = self.window.at_ns
            self.say("B set, ←→ moves A")
        self.moved(elsewhere=False)

    def command_pause(self) -> None:
        """Hold what is on the screen, with as much before it; or go on."""
        if self.pause.source is not None:
            self.go_on()
        else:
            ran = not self.window.paused
            self.pause_here()
            self.paused_alone = self.paused_alone or ran

    def command_export_plots(self) -> None:
        self.pause_here()
        ends = sorted(each for each in (self.window.at_ns, self.window.other_ns) if each is not None)
        shown_ns = (ends[0], ends[1] + 1) if len(ends) > 1 else self.shown_ns
        ask_export(self, self.source, self.stack.panels, shown_ns, self._zero_ns, between=len(ends) > 1)

    # --------------------------------------------------------------------------------------------------- commands

    def command_choose_plot(self, step: int) -> None:
        self._choose(self.stack.chosen + step)

    def command_choose_end(self, last: bool) -> None:
        self._choose(len(self.stack.plots) - 1 if last else 0)

    def on_plot_stack_pointed(self, event: PlotStack.Pointed) -> None:
        """Choose the plot that was clicked, and put the cursor there."""
        self._choose(event.index)
        store = self.stack.store
        if event.column is not None and self.window.paused and not store.empty:
            self._go_to((store.end - event.column) * store.column_ns - 1)
        elif event.column is not None:
            self.window.cursor = event.column
            self.stack.redraw()
        self.line.refresh()
        self.update_keys()

    def on_plot_stack_wheeled(self, event: PlotStack.Wheeled) -> None:
        names = ("closer", "wider") if event.zooms else ("plot_up", "plot_down")
        self.action_command(names[event.step > 0])

    def command_catch(self) -> None:
        """Let crossings of the chosen signal stand still: at the level of the cursor, else halfway."""
        from silo_tui.screens.plots.scope import ScopeScreen

        if self._refused("catch"):
            return
        chosen, panel = self.stack.chosen_plot, self.stack.panels[self.stack.chosen_panel]
        low, high = self.stack.span_of(chosen)
        at_cursor = (
            value_here(chosen, self.stack.readings) if self.window.paused and self.window.cursor is not None else ""
        )
        level = float(at_cursor) if at_cursor else halfway(low, high)
        plots = [chosen, *(each for each in panel if each != chosen and each.numeric)]
        settings = Scope(level, span_s=fitting_span(self.session.source.period_ns(chosen.element.name)))
        self.app.push_screen(ScopeScreen(self.session, plots, settings))

    def command_plot_trigger(self) -> None:
        if not self._refused("plot_trigger"):
            self.context.run_flow(self._ask_trigger())

    async def _ask_trigger(self) -> None:
        from silo_tui.screens.dialogs.trigger_editor import ask_trigger

        chosen, at_cursor = self.stack.chosen_plot, self.window.cursor is not None
        if at_cursor:
            self.pause_here()  # its moment would move on
        sought = self.search.crossing_here(chosen.name) if at_cursor else None
        level = value_here(chosen, await self.readings_here()) if at_cursor else ""
        level = level if sought is None else text.short(sought.level, 6)
        falling = sought is not None and sought.direction < 0
        await ask_trigger(self.context, await self.session.new_trigger(chosen.name, level, falling=falling))

    def command_zero(self) -> None:
        run_aside(self, "zero", self._zero)

    async def _zero(self) -> None:
        with self.context.telling(tell=self.say):
            await self.session.survey((), (), reset=True)
            self.say("statistics of the table from now on")

    # ------------------------------------------------------------------------- which signals share plots, on which axes

    def command_scale(self) -> None:
        self.window.fixed_scale = not self.window.fixed_scale
        self.stack.redraw()
        self.line.refresh()

    def command_log_axis(self) -> None:
        """Go over to powers of ten, or back, all signals of the axis together."""
        if self._refused("log_axis"):
            return
        panel, chosen = self.stack.panels[self.stack.chosen_panel], self.stack.chosen_plot
        right = sides(panel)
        side = right[panel.index(chosen)]
        mine = {plotted.name for plotted, its in zip(panel, right, strict=True) if its is side}
        if chosen.name in self.window.logs:
            self.window.logs -= mine
            self.say("y axis: linear")
        else:
            self.window.logs |= mine
            self.say("y axis: powers of ten (linear next to zero, where there are such values)")
        self.stack.redraw()

    def command_join_plots(self) -> None:
        if not self._refused("join_plots"):
            words = f"joined with {self._joins_with}; {key_of('isolate_plot')} parts them again"
            self._arrange(join(self.stack.panels, self.stack.chosen_panel, self.stack.most), words)

    @property
    def _joins_with(self) -> str:
        """The plot that the chosen one would be joined with, by its first signal: the next, of the last that above."""
        panels, at = self.stack.panels, self.stack.chosen_panel
        return self.session.short_name(panels[at + (1 if at + 1 < len(panels) else -1)][0].name)

    def value_now(self, command_id: str) -> str:
        """Return which plot is joined; and that what was joined can be parted."""
        if command_id == "join_plots" and len(self.stack.panels) > 1:
            names = tuple(self.session.short_name(each.name) for each in self.stack.plots)
            return f"with {fitted_among(self._joins_with, names, JOINED_NAME)}"
        return "parts again" if command_id == "isolate_plot" else super().value_now(command_id)

    def command_isolate_plot(self) -> None:
        if not self._refused("isolate_plot"):
            self._arrange(isolate(self.stack.panels, self.stack.chosen_plot))

    def command_arrange_plots(self) -> None:
        if not self._refused("arrange_plots"):
            self._arrange(*self._next_arrangement)

    def _arrange(self, panels: Sequence[Panel], words: str = "") -> None:
        self.stack.show_panels(panels)
        self.say(words)
        self.fill_soon()

    @property
    def _next_arrangement(self) -> tuple[list[Panel], str]:
        """The next arrangement that looks different, in words too; that which is there where none does."""
        plots, most = self.stack.plots, self.stack.most
        ways = (
            ("each alone", stacked(plots)),
            ("by unit", gathered(plots, by_unit=True, most=most)),
            ("as few plots as can be", gathered(plots, by_unit=False, most=most)),
        )
        at = max((place for place, (_, panels) in enumerate(ways) if panels == self.stack.panels), default=2)
        for words, panels in (ways[at + 1 :] + ways[: at + 1])[:2]:
            if panels != self.stack.panels:
                return panels, f"plots: {words}"
        return self.stack.panels, ""

    def label_now(self, command: Command) -> str:
        """Return it; of one plot there is no other way to stand."""
        if command.id == "add_plot":
            return "Plot more"
        if command.id == "find" and self.size.width >= ROOMY:  # what is found are moments, and no signals
            return "Find value"
        still = self.window.paused
        if command.id == "earlier" and still and self.end_ns - self.window.span_ns <= self.held_ns[0]:
            return ""
        if command.id in TO_BEFORE and not still and self.size.width < ROOMY and self.stack.display:
            return f"{key_of('earlier')} Earlier" if command.id == "cursor_left" else ""  # one entry for both has room
        if command.id in OF_LATER and not (self._looking_back or (still and self.end_ns < self.held_ns[1])):
            return ""
        return "" if command.id == "arrange_plots" and len(self.stack.plots) < 2 else super().label_now(command)

    def why_not_now(self, command_id: str) -> str:
        """Return why something can't be done with what is plotted: it needs two, or numbers."""
        stack = self.stack
        if not stack.plots:  # what was is no longer in the table
            return "nothing is plotted" if command_id in OF_PLOTS else super().why_not_now(command_id)
        if command_id == "join_plots":
            try:
                join(stack.panels, stack.chosen_panel, stack.most)
            except ValueError as refused:
                more = f": {key_of('add_plot')} plots another" if len(stack.panels) < 2 else ""
                return f"{refused}{more}"
        if command_id in OF_WHAT_GOES_ON and self.pause.source is not None:  # what is held are the plots of when it was
            then = f"{key_of(command_id)} {OF_WHAT_GOES_ON[command_id]}"
            return f"paused: {key_of('pause')} goes on, then {then}"
        chosen, panel = stack.chosen_plot, stack.panels[stack.chosen_panel]
        is_on = chosen.numeric and self.session.source.is_live(chosen.element.name)
        vector = len(chosen.element.entries) > 1
        needs = {
            "isolate_plot": (len(panel) > 1, "it is alone in its plot"),
            "arrange_plots": (self._next_arrangement[0] != stack.panels, "these can't be arranged in another way"),
            "all_entries": (vector, ONE_VALUE),
            "next_entry": (len(self._left_entries) > 1, "all entries of it are plotted" if vector else ONE_VALUE),
            "log_axis": (
                has_curves(panel) and chosen.entry.dtype[1:2] not in "Mm",
                "only numbers have an axis with powers of ten",
            ),
            "catch": (is_on, "the scope needs a signal of numbers that is on"),
            "plot_trigger": (chosen.numeric, "a trigger needs a signal of numbers"),
        }
        is_met, why = needs.get(command_id, (True, ""))
        return super().why_not_now(command_id) if is_met else why

    @property
    def plots_of_detail(self) -> Sequence[Plotted]:
        """What a large plot has, of which two can be drawn over each other."""
        return self.stack.for_detail()[0]

    def _refused(self, command_id: str) -> bool:
        """Return whether something can't be done now, and say why."""
        why = self.why_not_now(command_id)
        if why:
            self.say(why)
        return bool(why)

    def command_drop_plot(self) -> None:
        plots = self.stack.plots
        if len(plots) > 1:
            name = self.session.short_name(self.stack.chosen_plot.name)
            self.stack.keep([plotted for plotted in plots if plotted != self.stack.chosen_plot])
            self.say(f"{name} is left out; {key_of('add_plot')} plots it again")
            self.fill_soon()
        else:
            self.action_command("back")

    def command_next_entry(self) -> None:
        """Go over to the next entry of the vector."""
        if self._refused("next_entry"):
            return
        chosen, others = self.stack.chosen_plot, self._left_entries
        self._replace([others[(others.index(chosen) + 1) % len(others)]], [chosen])

    @property
    def _left_entries(self) -> list[Plotted]:
        """The entries of the chosen element that aren't plotted, and the chosen one."""
        chosen = self.stack.chosen_plot
        return [each for each in plots_of([chosen.element]) if each == chosen or each not in self.stack.plots]

    def command_all_entries(self) -> None:
        """Plot all entries of the vector, or the chosen one alone."""
        if self._refused("all_entries"):
            return
        chosen = self.stack.chosen_plot
        every = plots_of([chosen.element])
        shown = [each for each in self.stack.plots if each in every]
        if len(shown) < len(every):
            self._replace(every, shown)
        else:
            self._replace([chosen], shown)

    def _replace(self, plots: Sequence[Plotted], shown: Sequence[Plotted]) -> None:
        """Plot some entries in place of others of their element, which share plots no more."""
        panels: list[Panel] = []
        for panel in self.stack.panels:
            rest = tuple(each for each in panel if each not in shown)
            panels += [rest] if rest else []
            if self.stack.chosen_plot in panel:
                panels += stacked(plots)
        self.stack.show_panels(panels)
        self.stack.choose(self.stack.plots.index(plots[0]))
        self.say("")
        self.fill_soon()

    def command_show_as(self, mode: str) -> None:
        """Show the chosen plot alone in a view; over another, which is asked for where there is none."""
        if mode == "x-y" and self.stack.plots and len(self.plots_of_detail) < 2:
            self.begin_command("xy")
        else:
            self.show_as(mode)

    def show_as(self, mode: str) -> None:
        """Show the chosen plot alone in a view."""
        cast(Any, self.app).show_large(mode)

    def command_add_plot(self, typed: Spelled = BY_KEY) -> None:
        """Plot more signals, below the others; what stands still goes on with them. By `xy` the chosen one is drawn
        over the first of them.
        """
        if self._refused("add_plot"):
            return
        if typed is BY_KEY:
            self.begin_command("plot")
            return
        if not typed.arguments:
            raise ValueError(WHAT_TO_PLOT)
        there, short, off = self.pinned_plots, self.session.short_name, []
        new: list[Plotted] = []
        for place, index in self.session.named(typed.arguments, scalars=True):
            element = self.session.table.elements[place]
            every = plots_of([element])
            if not self.session.source.is_live(element.name):
                off.append(short(element.name))
            new += [each for each in (every if index is None else [every[index]]) if each not in (*there, *new)]
        if off:
            words = f"{and_more(off, 3)} {'is' if len(off) == 1 else 'are'} off"
            raise ValueError(f"{words}: {key_of('toggle')} in the table switches on")
        if new:
            if self.pause.source is not None:  # what is held are the plots of when it was
                self.go_on()
            chosen = self.stack.chosen
            self.add(new)
            if typed.word == "xy" and len(self.plots_of_detail) > 1:
                self.stack.choose(chosen)
                self.show_as("x-y")
        else:
            self.say("that is plotted already")

    def add(self, new: Sequence[Plotted]) -> None:
        """Plot these below the others."""
        stack = self.stack
        stack.keep([*stack.plots, *new])
        stack.choose(stack.plots.index(new[0]))
        joins = not self.why_not_now("join_plots") and len(new) == 1
        added = added_words([self.session.short_name(each.name) for each in new])
        self.say(f"{added}; {key_of('join_plots')} lays it over the plot above" if joins else added)
        self.fill_soon()

    # ----------------------------------------------------------------------------------------------------- the way back

    def go_on(self) -> None:
        """Show what comes again; what was found lies behind."""
        self.search.found, self.came_at_moment = None, False
        super().go_on()

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        live = self.session.source.live  # what is held stands still, of a logger that goes on
        paused = (
            (("pause", "Go on" if self.pause.source is not None else "Hold"),) if self.window.paused and live else ()
        )
        back, _ = self.way_back()
        joins = (("join_plots", "Join"),) if self.scope.endswith("monitor") and len(self.stack.panels) == 2 else ()
        if self.came_with_file:  # its table was not asked for
            return (("back", "Back"), ("go_home", "Its table"), *joins)
        far = f"{key_of('cursor_far_left')} " if self.size.width >= ROOMY else ""  # by one, and by ten
        cursor = ("cursor_left", f"{far}Cursor".lstrip())
        return (*paused, cursor, ("back", back), *joins) if back else (*paused, *joins)

    def way_back(self) -> tuple[str, Callable[[], None]]:
        """Return what Esc leaves, in words for the key bar, and how: B, the cursor, the pause; empty: the screen.

        What one key entered, as a find its pause and its cursor, is left by one.
        """
        if self.file is not None:
            return "", self.context.leave_file if self.came_with_file else self.context.leave_screen
        if self.window.other_ns is not None:
            return "No B", self.command_cursor_b
        held = self.window.paused and self.pause.possible
        if held and self.came_at_moment:
            return "Back", self.context.leave_screen
        if self.window.cursor is not None and (self.paused_alone or not held):
            return "No cursor", self._lift_cursor
        if held:
            return "Live", self.go_on
        return "", self.context.leave_screen

    def _lift_cursor(self) -> None:
        self.window.cursor = self.window.at_ns = None
        self.moved(elsewhere=False)  # the values are those of the right end again

    def command_back(self) -> None:
        self.way_back()[1]()
