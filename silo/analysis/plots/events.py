"""What happened during a log, on its own scale of time: `log.events`, lines in plots, the table of `silo info`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from silo.analysis.compute.run_starts import run_start
from silo.core.elements import LoggedEvent
from silo.core.episodes.words import Episode, found_episodes
from silo.core.quantities.writing import EPOCH_FROM_NS
from silo.core.recording import Recording, falls

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
    """Return what happened, in the order of time; seconds count from `start_ns`.

    Of a clock that is not the system's, what has no tick counts from the start of the run by the system's; where such a
    clock stepped back, all stand as they were told.
    """
    own, began = start_ns < EPOCH_FROM_NS, run_start(recording)
    began_ns = start_ns if began is None else began.stamp_ns

    def seconds(event: LoggedEvent) -> float:
        by_system = own and event.at_ns >= EPOCH_FROM_NS
        at_ns = event.at_ns - recording.started_ns + began_ns if by_system else event.at_ns
        return (at_ns - start_ns) * 1e-9

    found = [
        LogEvent(event.tick, event.at_ns, seconds(event), event.kind, event.text, event.who)
        for event in recording.events
    ]
    return found if falls(recording.time_ns) else sorted(found, key=lambda one: one.seconds)


def episodes_of(recording: Recording, start_ns: int) -> list[Episode]:
    """Return the episodes that the recording has a part of; seconds count from `start_ns`."""
    time_ns, before = recording.time_ns, recording.offset - len(recording.time_ns)

    def seconds(tick: int) -> float:
        return (int(time_ns[min(max(tick - before, 0), len(time_ns) - 1)]) - start_ns) * 1e-9

    return [
        replace(one, start_s=seconds(one.first), stop_s=max(seconds(one.last), seconds(one.first)))
        for one in found_episodes(recording.events, recording.offset)
        if len(time_ns) and one.last >= before and one.first < recording.offset
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
