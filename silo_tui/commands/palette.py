"""The command palette: every deed of the screen, found by what it is called and what it does."""

from functools import partial
from typing import cast

from textual.command import DiscoveryHit, Hit, Hits, Provider

from silo_tui.actions import Deed, deeds_for
from silo_tui.screens.base import SiloScreen

HIDDEN = {"down", "up", "left", "right", "palette", "back", "quit_now"}


class DeedProvider(Provider):
    """Feeds the palette from the list of deeds."""

    async def discover(self) -> Hits:
        """Everything, before anything is typed."""
        for deed in self._deeds():
            yield DiscoveryHit(self._title(deed), partial(self._do, deed.id), help=deed.help)

    async def search(self, query: str) -> Hits:
        """What matches."""
        matcher = self.matcher(query)
        for deed in self._deeds():
            score = max(matcher.match(deed.label), matcher.match(deed.help))
            if score > 0:
                yield Hit(score, matcher.highlight(self._title(deed)), partial(self._do, deed.id), help=deed.help)

    def _deeds(self) -> list[Deed]:
        if not isinstance(self.screen, SiloScreen):
            return []
        return [deed for deed in deeds_for(self.screen.scope) if deed.id not in HIDDEN]

    def _title(self, deed: Deed) -> str:
        return f"{deed.label}  ({deed.key_text})"

    def _do(self, deed_id: str) -> None:
        cast(SiloScreen, self.screen).action_deed(deed_id)
