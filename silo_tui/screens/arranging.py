# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Which signals are plotted, which share a plot, and how their axes run: a part of the monitor."""

from collections.abc import Sequence

from silo_tui.model.panels import Panel, gathered, has_curves, isolate, join, sides, stacked
from silo_tui.model.plots import Plotted, plots_of
from silo_tui.screens.searching import Searching


class Arranging(Searching):
    """The commands of a monitor that change its plots."""

    def fill_soon(self) -> None:
        """Request view and history anew, when what is wanted has settled."""
        raise NotImplementedError

    def command_back(self) -> None:
        raise NotImplementedError

    def command_scale(self) -> None:
        self.window.fixed_scale = not self.window.fixed_scale
        self.stack.redraw()
        self.line.refresh()

    def command_log_axis(self) -> None:
        """Go over to powers of ten, or back, all signals of the axis together."""
        panel, chosen = self.stack.panels[self.stack.chosen_panel], self.stack.chosen_plot
        if not has_curves(panel) or chosen.entry.dtype[1:2] in "Mm":
            self.say("only numbers have an axis with powers of ten")
            return
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
        try:
            self.stack.show_panels(join(self.stack.panels, self.stack.chosen_panel, self.stack.most))
        except ValueError as refused:
            self.say(f"{refused}; nothing was changed")
            return
        self._said = ""
        self.fill_soon()

    def command_isolate_plot(self) -> None:
        self.stack.show_panels(isolate(self.stack.panels, self.stack.chosen_plot))
        self.fill_soon()

    def command_arrange_plots(self) -> None:
        """Go on to the next arrangement that looks different."""
        plots, most = self.stack.plots, self.stack.most
        ways = (
            ("each alone", stacked(plots)),
            ("by unit", gathered(plots, by_unit=True, most=most)),
            ("as few plots as can be", gathered(plots, by_unit=False, most=most)),
        )
        at = max((place for place, (_, panels) in enumerate(ways) if panels == self.stack.panels), default=2)
        for words, panels in (ways[at + 1 :] + ways[: at + 1])[:2]:
            if panels != self.stack.panels:
                self.stack.show_panels(panels)
                self.say(f"plots: {words}")
                self.fill_soon()
                return
        self.say("these can't be arranged in another way")

    def command_drop_plot(self) -> None:
        plots = self.stack.plots
        if len(plots) > 1:
            self.stack.keep([plotted for plotted in plots if plotted != self.stack.chosen_plot])
            self.fill_soon()
        else:
            self.command_back()

    def command_next_entry(self) -> None:
        """Go over to the next entry of the vector."""
        chosen = self.stack.chosen_plot
        others = [each for each in plots_of([chosen.element]) if each == chosen or each not in self.stack.plots]
        if len(others) < 2:
            self.say("all entries of it are plotted" if len(chosen.element.entries) > 1 else "no vector: one value")
            return
        self._replace([others[(others.index(chosen) + 1) % len(others)]], [chosen])

    def command_all_entries(self) -> None:
        """Plot all entries of the vector, or the chosen one alone."""
        chosen = self.stack.chosen_plot
        every = plots_of([chosen.element])
        shown = [each for each in self.stack.plots if each in every]
        if len(every) < 2:
            self.say("no vector: one value")
        elif len(shown) < len(every):
            self._replace(every, shown)
        else:
            self._replace([chosen], shown)

    def _replace(self, plots: Sequence[Plotted], shown: Sequence[Plotted]) -> None:
        """Plot some entries in place of others of their element, which share plots no more."""
        if self.pause.source is not None:
            self.say("what is held are the plots of when it was: space goes on")
            return
        panels: list[Panel] = []
        for panel in self.stack.panels:
            rest = tuple(each for each in panel if each not in shown)
            panels += [rest] if rest else []
            if self.stack.chosen_plot in panel:
                panels += stacked(plots)
        self.stack.show_panels(panels)
        self.stack.choose(self.stack.plots.index(plots[0]))
        self._said = ""
        self.fill_soon()
