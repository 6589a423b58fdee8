"""What a person says of the episodes of a logger that runs: by `silo episode`, and by keys of silo-tui."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from silo.core.elements import LoggedEvent
from silo.core.episodes.words import next_marks

if TYPE_CHECKING:
    from silo.client.client import Client

MOST_READ = 10_000  # of the newest events


def say_of_episode(
    client: "Client", word: str, name: str = "", about: Mapping[str, object] | None = None
) -> LoggedEvent:
    """Mark that an episode begins, ends, or went well or not, and return the last mark. Raises as `Client.mark`."""
    events = [] if word == "begin" else client.events(limit=MOST_READ)
    return [client.mark(text) for text in next_marks(events, word, name, about)][-1]
