"""What widgets share that draw their lines themselves: styles, found once, colours of signals, cells as segments."""

from collections.abc import Sequence
from functools import cache, cached_property
from itertools import pairwise

from rich.segment import Segment
from rich.style import Style
from textual.app import App
from textual.widget import Widget

# colours of signals that share a plot; letters tell them apart as well
# what becomes 14, 11, 13, 10, 9, 12, 15, 6 of 16 colours; no bright black (unseen in Solarized), no dark blue
_IN_16 = ("#55ffff", "#ffff55", "#ff55ff", "#55ff55", "#ff5555", "#5555ff", "#ffffff", "#00aaaa")
_DARK = ("#6cb2eb", "#e8c55a", "#d58ff0", "#7fd18b", "#f07f74", "#8b9cff", "#f2f2f2", "#3fa7a0")
_LIGHT = ("#2563b0", "#8a6500", "#8b2fa8", "#2f7d36", "#b93a2f", "#4a4ae0", "#202020", "#0e7c78")


class Styled(Widget):
    """Knows its component styles: found anew for each line they were a third of what a frame of plots costs."""

    @cached_property
    def _styles(self) -> dict[str, Style]:
        return {}

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._styles.clear()

    def _style(self, *names: str) -> Style:
        """Return a style, with what others lay over it."""
        key = " ".join(names)
        if key not in self._styles:
            style = self.get_component_rich_style(names[0])
            for name in filter(None, names[1:]):
                style += self.get_component_rich_style(name, partial=True)
            self._styles[key] = style
        return self._styles[key]


def segments_of(chars: Sequence[str], styles: Sequence[Style]) -> list[Segment]:
    """Return cells as segments, those of one style together."""
    line = "".join(chars)
    edges = [at for at in range(1, len(line)) if styles[at] is not styles[at - 1]]
    return [Segment(line[start:stop], styles[start]) for start, stop in pairwise([0, *edges, len(line)]) if line]


def series_style(app: App[object], place: int) -> Style:
    """Return the colour of the signal at a place in its plot, in as many colours as the terminal has."""
    return _style(place % len(_IN_16), app.console.color_system == "standard", app.current_theme.dark)


@cache
def _style(place: int, few: bool, dark: bool) -> Style:
    colors = _IN_16 if few else _DARK if dark else _LIGHT
    return Style(color=colors[place])
