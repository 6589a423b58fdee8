"""What happened during a log, on its own scale of time: `log.events`, lines in plots, the table of `silo info`."""

from collections.abc import Sequence
from dataclasses import dataclass

from silo.core.recording import Recording

MOST_SHOWN = 20


@dataclass(frozen=True)
class LogEvent:
    """Something that happened: a mark, a start, a stop, a loss ...

    `tick` counts since start (-1: before the first). `time_ns` is that tick's time stamp, or the wall clock's where the
    log doesn't hold the tick; `seconds` the same from the first time stamp of the log on. `who` is a client as it names
    itself (`alice@desk silo-tui 4711`), or the logger.
    """

    tick: int
    time_ns: int
    seconds: float
    kind: str
    text: str
    who: str = ""

    @property
    def words(self) -> str:
        """Kind and text, each said once."""
        return self.text if self.text.startswith(self.kind) else f"{self.kind} {self.text}"


def events_of(recording: Recording, start_ns: int) -> list[LogEvent]:
    """Return what happened, in the order of time; seconds count from `start_ns`."""
    return [
        LogEvent(event.tick, event.at_ns, (event.at_ns - start_ns) * 1e-9, event.kind, event.text, event.who)
        for event in recording.events
    ]


def event_lines(events: Sequence[LogEvent]) -> list[str]:
    """Return a line for each of the first few: seconds, tick, what, who."""
    lines = [
        f"{event.seconds:12.6f} s  tick {event.tick:<9} {event.words}{f'  ({event.who})' if event.who else ''}"
        for event in events[:MOST_SHOWN]
    ]
    if len(events) > MOST_SHOWN:
        lines.append(f"{len(events) - MOST_SHOWN} more events: `silo events FILE` lists all")
    return lines
