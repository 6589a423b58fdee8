"""Looking through samples that are here."""

from silo.judging.moments import Finder, Found, Looking
from silo_tui.model.source import Samples


def found_in(looking: Looking, samples: Samples, around_ns: int, most: int) -> Found:
    """Return the moments of one signal, the `most` next to a time."""
    finder = Finder(looking, around_ns, most)
    if looking.needs_span:
        finder.measure(samples[1])
    finder.feed(*samples)
    return finder.found
