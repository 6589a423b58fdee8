"""The command palette: every command of the screen, found by what it is called and what it does."""

from functools import partial
from typing import cast

from textual.command import DiscoveryHit, Hit, Hits, Provider

from silo_tui.actions import Command, commands_for
from silo_tui.context import SiloScreen


class CommandProvider(Provider):
    """Feeds the palette from the list of commands."""

    async def discover(self) -> Hits:
        """Return everything, before anything is typed."""
        for command in self._commands():
            yield DiscoveryHit(self._title(command), partial(self._do, command.id), help=command.help)

    async def search(self, query: str) -> Hits:
        """Return what matches."""
        matcher = self.matcher(query)
        for command in self._commands():
            score = max(matcher.match(command.label), matcher.match(command.help))
            if score > 0:
                yield Hit(
                    score, matcher.highlight(self._title(command)), partial(self._do, command.id), help=command.help
                )

    def _commands(self) -> list[Command]:
        if not isinstance(self.screen, SiloScreen):
            return []
        keys = self.screen.context.settings.keys
        return [command for command in commands_for(self.screen.scope, keys) if not command.hidden]

    def _title(self, command: Command) -> str:
        return f"{command.label}  ({command.key_text})"

    def _do(self, command_id: str) -> None:
        cast(SiloScreen, self.screen).action_command(command_id)
