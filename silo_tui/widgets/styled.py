"""What widgets share that draw their lines themselves: their styles, found once, and cells as segments."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

from rich.segment import Segment
from rich.style import Style
from textual.widget import Widget


class Styled(Widget):
    """Knows its component styles: found anew for each line they were a third of what a frame of plots costs."""

    @cached_property
    def _styles(self) -> dict[str, Style]:
        return {}

    def notify_style_update(self) -> None:
        """Follow a change of the theme."""
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
