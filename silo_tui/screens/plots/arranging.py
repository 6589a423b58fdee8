# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Which signals are plotted, which share a plot, and how their axes run: a part of the monitor."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from silo_tui.model.drawing.plots import Plotted, plots_of
from silo_tui.model.plots.panels import Panel, gathered, has_curves, isolate, join, sides, stacked

if TYPE_CHECKING:
    from silo_tui.screens.plots.plot_screen import PlotScreen


class Arranger:
    """The commands of a monitor that change its plots."""

    def __init__(self, screen: "PlotScreen") -> None:
        self.screen = screen

    def command_scale(self) -> None:
        self.screen.window.fixed_scale = not self.screen.window.fixed_scale
        self.screen.stack.redraw()
        self.screen.line.refresh()

    def command_log_axis(self) -> None:
        """Go over to powers of ten, or back, all signals of the axis together."""
        panel, chosen = self.screen.stack.panels[self.screen.stack.chosen_panel], self.screen.stack.chosen_plot
        if not has_curves(panel) or chosen.entry.dtype[1:2] in "Mm":
            self.screen.say("only numbers have an axis with powers of ten")
            return
        right = sides(panel)
        side = right[panel.index(chosen)]
        mine = {plotted.name for plotted, its in zip(panel, right, strict=True) if its is side}
        if chosen.name in self.screen.window.logs:
            self.screen.window.logs -= mine
            self.screen.say("y axis: linear")
        else:
            self.screen.window.logs |= mine
            self.screen.say("y axis: powers of ten (linear next to zero, where there are such values)")
        self.screen.stack.redraw()

    def command_join_plots(self) -> None:
        try:
            self.screen.stack.show_panels(
                join(self.screen.stack.panels, self.screen.stack.chosen_panel, self.screen.stack.most)
            )
        except ValueError as refused:
            self.screen.say(f"{refused}; nothing was changed")
            return
        self.screen.say("")
        self.screen.fill_soon()

    def command_isolate_plot(self) -> None:
        self.screen.stack.show_panels(isolate(self.screen.stack.panels, self.screen.stack.chosen_plot))
        self.screen.fill_soon()

    def command_arrange_plots(self) -> None:
        """Go on to the next arrangement that looks different."""
        plots, most = self.screen.stack.plots, self.screen.stack.most
        ways = (
            ("each alone", stacked(plots)),
            ("by unit", gathered(plots, by_unit=True, most=most)),
            ("as few plots as can be", gathered(plots, by_unit=False, most=most)),
        )
        at = max((place for place, (_, panels) in enumerate(ways) if panels == self.screen.stack.panels), default=2)
        for words, panels in (ways[at + 1 :] + ways[: at + 1])[:2]:
            if panels != self.screen.stack.panels:
                self.screen.stack.show_panels(panels)
                self.screen.say(f"plots: {words}")
                self.screen.fill_soon()
                return
        self.screen.say("these can't be arranged in another way")

    def command_drop_plot(self) -> None:
        plots = self.screen.stack.plots
        if len(plots) > 1:
            self.screen.stack.keep([plotted for plotted in plots if plotted != self.screen.stack.chosen_plot])
            self.screen.fill_soon()
        else:
            self.screen.action_command("back")

    def command_next_entry(self) -> None:
        """Go over to the next entry of the vector."""
        chosen = self.screen.stack.chosen_plot
        others = [each for each in plots_of([chosen.element]) if each == chosen or each not in self.screen.stack.plots]
        if len(others) < 2:
            self.screen.say(
                "all entries of it are plotted" if len(chosen.element.entries) > 1 else "no vector: one value"
            )
            return
        self._replace([others[(others.index(chosen) + 1) % len(others)]], [chosen])

    def command_all_entries(self) -> None:
        """Plot all entries of the vector, or the chosen one alone."""
        chosen = self.screen.stack.chosen_plot
        every = plots_of([chosen.element])
        shown = [each for each in self.screen.stack.plots if each in every]
        if len(every) < 2:
            self.screen.say("no vector: one value")
        elif len(shown) < len(every):
            self._replace(every, shown)
        else:
            self._replace([chosen], shown)

    def _replace(self, plots: Sequence[Plotted], shown: Sequence[Plotted]) -> None:
        """Plot some entries in place of others of their element, which share plots no more."""
        if self.screen.pause.source is not None:
            self.screen.say("what is held are the plots of when it was: space goes on")
            return
        panels: list[Panel] = []
        for panel in self.screen.stack.panels:
            rest = tuple(each for each in panel if each not in shown)
            panels += [rest] if rest else []
            if self.screen.stack.chosen_plot in panel:
                panels += stacked(plots)
        self.screen.stack.show_panels(panels)
        self.screen.stack.choose(self.screen.stack.plots.index(plots[0]))
        self.screen.say("")
        self.screen.fill_soon()
