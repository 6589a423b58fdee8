"""What stands in a log folder, held against one another: recordings, captures, saved logs, event log and runs.

Looks for ticks that were collected and are in no file though they were to be, for what stands twice, and for totals
that disagree. What somebody told to be missing is told again, apart from that. Reads, never changes.
"""

import contextlib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from silo.core.arrays.spans import Span, doubled, merged, spans_text, without
from silo.core.elements import DAMAGED, Action, BufferType, LoggedEvent
from silo.core.quantities.writing import and_more, count, many
from silo.core.recording import Recording
from silo.core.runtime import SEGMENT_SUFFIX, read_own
from silo.errors import LogNotFoundError, SegmentError, SiloError
from silo.files.bag_reader import damage_of_bag
from silo.files.csv.reader import damage_of_csv
from silo.files.event_log import event_log_path, loggers_with_events, older_event_log, read_events
from silo.files.formats import read_recording
from silo.files.manifest import WRITTEN_ENDING, CaptureEntry, read_captures, read_written
from silo.files.mcap.chunks import mapped
from silo.files.mcap.damage import DAMAGE
from silo.files.naming import find_logs
from silo.files.parts.metadata import EVENTS_RING, PART_ENDING, RingFacts
from silo.files.parts.scan import CUT_SHORT, PartScan, scan_part
from silo.files.silo.reader import damage_of
from silo.recorder.orders import CLOSED
from silo.rpc.published import EventKind
from silo.segment.held_runs import all_runs
from silo.segment.layout import ElementSchema, RingSchema
from silo.segment.reader import SegmentReader
from silo.verify.gone import captures_that_lack, parts_that_lack, saves, saves_that_lack
from silo.verify.runs import KnownRun, ScannedPart
from silo.verify.verdicts import MOST_SHOWN, RunCovered, Verdict, Verified

_TOTALS = re.compile(
    r"recording '(?P<name>[^']+)'.*?(?P<parts>[\d ]+) files?, (?P<samples>[\d ]+) samples?, (?P<lost>\d+) lost"
)
_LOST_AT = re.compile(r"recording '(?P<name>[^']+)': (?P<lost>\d+) samples were lost, of ticks \d+ to (?P<last>\d+)")
_ENDED = re.compile(r"recording '(?P<name>[^']+)'.*(ended|stopped|files?, [\d ]+ samples?)")
_BEGUN = re.compile(r"recording '(?P<name>[^']+)' of .* to (?P<folder>/.*)")
_UNCOUNTED = re.compile(r"lost, and the end of (a run|\d+ runs)")
_FULL = "come to an end when their buffers are full"
_FIRED = re.compile(r"trigger '(?P<name>[^']+)' fired")
_CAPTURED = re.compile(r"capture (?P<number>\d+) of '(?P<name>[^']+)', ticks (?P<first>\d+) to (?P<last>\d+)")
_DIED = ("program died", "program died, recovered later", "program ended without saving")


class _Folder:
    """What stands in a folder, by run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs: dict[str, KnownRun] = {}
        self.verdicts: list[Verdict] = []
        self.captures: dict[str, list[CaptureEntry]] = {}
        self.events: dict[str, Sequence[LoggedEvent]] = {}
        self.stretches: dict[tuple[str, str], set[int]] = {}  # the parts that were saved of runs that were cut
        # by logger and name, the events that tell of a recording that it was begun (True) or ended
        self.orders: dict[tuple[str, str], list[tuple[LoggedEvent, bool]]] = {}
        self.elsewhere: set[tuple[str, str]] = set()  # those that are written to other folders
        self.keeps: dict[tuple[str, str], int] = {}  # by logger and trigger, how many captures stay; 0 for all
        self.gone: set[str] = set()  # the loggers of which files lack
        self.loggers = loggers_with_events(folder)
        for logger in self.loggers:
            self._take_events(logger)
            self.captures[logger] = read_captures(folder, logger)
        self._take_parts()
        self._take_memory()
        self._take_logs()
        self._take_saves_elsewhere()
        self._take_ledgers()
        names = frozenset(path.name for path in folder.rglob("*"))
        for logger in self.loggers:
            lacks = [
                *saves_that_lack(folder, names, logger, self.events[logger]),
                *captures_that_lack(names, logger, self.captures[logger], self.keeps),
            ]
            self.verdicts += lacks
            self.gone |= {logger} if lacks else set()
        self.verdicts += parts_that_lack(
            {run: some for run, some in self.stretches.items() if run[0] not in self.events}
        )
        if not self.runs and not self.loggers:
            raise LogNotFoundError(f"{folder}: there are no logs, no recordings and no event log in it")

    def run_of(self, logger: str, run: str, started_ns: int = 0) -> KnownRun:
        """The run of that id, or of that start where the file has no id of it."""
        if not run:
            known = (one for one in self.runs.values() if started_ns and one.started_ns == started_ns)
            run = next((one.run for one in known if one.logger == logger), f"started {started_ns}")
        found = self.runs.setdefault(run, KnownRun(logger, run))
        found.started_ns = found.started_ns or started_ns
        return found

    def _take_events(self, logger: str) -> None:
        lines: Counter[bytes] = Counter()
        for path in (older_event_log(self.folder, logger), event_log_path(self.folder, logger)):
            with contextlib.suppress(FileNotFoundError):
                lines.update(filter(None, read_own(path).splitlines()))
        again = sum(count - 1 for count in lines.values())
        if again:
            text = f"{again} lines of the event log of '{logger}' stand in it twice"
            self.verdicts.append(Verdict("twice", text, logger))
        self.events[logger] = read_events(self.folder, logger)
        for event in self.events[logger]:
            if event.kind == DAMAGED:
                self.verdicts.append(Verdict("damaged", event.text, logger, event.run, told="the event log"))
            if event.kind in (EventKind.RECORDING.value, EventKind.RECORDING_FAILED.value):
                begun = _BEGUN.match(event.text)
                if (about := begun or _ENDED.match(event.text)) is not None:
                    key = logger, about["name"]
                    self.orders.setdefault(key, []).append((event, begun is not None))
                    if begun is not None:
                        place = Path(begun["folder"])
                        is_here = self.folder.resolve() in (place, place.parent)
                        (self.elsewhere.discard if is_here else self.elsewhere.add)(key)
            if not event.run:
                continue
            run = self.run_of(logger, event.run)
            run.events.append(event)
            if event.tick or event.stamp_ns:  # at tick 0 stands what comes before the first one, too
                # a parameter holds from a tick on that may never have come
                run.ticks = max(run.ticks, event.tick + (event.kind != EventKind.PARAMETER.value))
            run.ended |= event.kind in (EventKind.STOPPED.value, EventKind.CRASHED.value)
            if event.kind == EventKind.STARTED.value:
                run.started_ns = event.time_ns

    def _take_parts(self) -> None:
        for path in sorted([*self.folder.glob("*.mcap*"), *self.folder.glob("*/*.mcap*")]):
            if not path.is_file() or path.parent.name.endswith(".rosbag2"):
                continue
            try:
                with path.open("rb") as file:
                    scan = scan_part(mapped(file))
            except (SiloError, OSError, *DAMAGE) as error:
                self.verdicts.append(Verdict("damaged", f"{path.relative_to(self.folder)} can't be read: {error}"))
                continue
            if scan.facts is None:
                continue  # a bag
            about = scan.facts.recording
            name = path.relative_to(self.folder)
            damaged = [*scan.damaged, *([] if scan.finished or path.name.endswith(PART_ENDING) else [CUT_SHORT])]
            self.verdicts += [Verdict("damaged", f"{name}: {one}", about.logger, scan.facts.run) for one in damaged]
            run = self.run_of(about.logger, scan.facts.run, about.started_ns)
            run.parts.append(ScannedPart(path, scan))
            run.ticks = max([run.ticks, *(last + 1 for _, last in run.parts[-1].ticks())])

    def _take_logs(self) -> None:
        with contextlib.suppress(LogNotFoundError):
            for path in find_logs(self.folder):
                try:
                    recording = read_recording(path)
                    damage = _damage_of(path)
                except SiloError as error:
                    self.verdicts.append(Verdict("damaged", f"{path.name} can't be read: {error}"))
                    continue
                self._take_log(path, recording)
                self.verdicts += [Verdict("damaged", f"{path.name}: {text}", recording.logger) for text in damage]

    def _take_saves_elsewhere(self) -> None:
        """What was saved to other folders, as the event log tells: it is in a file, if not in one of these."""
        for logger in self.loggers:
            for event, _, others in saves(self.folder, self.events[logger]):
                for path in others:
                    if not self._taken(path) and event.run:
                        self.run_of(logger, event.run).away.append(f"{path} (event {event.number})")

    def _taken(self, path: Path) -> bool:
        try:
            self._take_log(path, read_recording(path))
        except (SiloError, OSError):
            return False
        return True

    def _take_log(self, path: Path, recording: Recording) -> None:
        run = self.run_of(recording.logger, recording.likely_run, recording.started_ns)
        self.keeps |= {(recording.logger, one.name): one.keep for one in recording.conditions.triggers}
        run.ticks = max(run.ticks, recording.offset)
        if recording.conditions.capture is not None:
            run.captured.append((path, recording))
        elif len(recording.time_ns):
            begin, last = recording.offset - len(recording.time_ns), recording.offset - 1
            firsts = {one.name: (one, begin + one.first) for one in recording.elements if one.count}
            run.saved.append((path, (min((tick for _, tick in firsts.values()), default=begin), last), recording.why))
            stretch = recording.stretch
            if stretch is not None:
                self.stretches.setdefault((recording.logger, stretch.run), set()).add(stretch.part)
            part = max(1, stretch.part) if stretch is not None else 1
            for one in recording.elements:
                if stretch is None or not stretch.recorder:  # else it lacks what its parts lack
                    run.lose(part, one.name, one.lost)
            for name, (one, tick) in firsts.items():
                if one.buffer_type is BufferType.LOOPING:
                    run.hold(name, tick, last, one.divider)

    def _take_memory(self) -> None:
        for reader in all_runs(folder=self.folder):
            with contextlib.suppress(SegmentError), contextlib.closing(reader):
                if Path(reader.schema.folder).resolve() != self.folder.resolve():
                    continue
                run = self.run_of(reader.schema.logger, reader.schema.run, reader.schema.started_ns)
                run.ticks = max(run.ticks, reader.ticks)
                run.ended |= reader.path.suffix != SEGMENT_SUFFIX or not reader.alive()
                if reader.ticks and not reader.dropped:
                    last = reader.ticks - 1
                    run.memory.append((max(0, reader.rows(0, 0, 1).first), last))
                    there = [(element, *_oldest(reader, element.ring)) for element in _kept_elements(reader)]
                    run.held.append((min((tick for _, _, tick in there), default=0), last))
                    for element, ring, tick in there:
                        run.lose(reader.schema.stretch[1], element.info.name, reader.ring_lost(element.ring))
                        if ring.buffer_type is BufferType.LOOPING:
                            run.hold(element.info.name, tick, last, ring.divider)

    def _take_ledgers(self) -> None:
        """What the lists of recorders say was recorded of runs, and whether a budget deleted of it."""
        for path in sorted([*self.folder.glob(f".*{WRITTEN_ENDING}"), *self.folder.glob(f"*/.*{WRITTEN_ENDING}")]):
            written = read_written(path.parent, path.name[1:].removesuffix(WRITTEN_ENDING))
            for entry in written.runs if written is not None else ():
                run = self.runs.get(entry.run)
                if written is None or run is None or not entry.parts:
                    continue
                had = merged(
                    (entry.begin.get(ring, 0) * divider, entry.end.get(ring, 0) * divider - 1)
                    for ring in entry.channels
                    for divider in [entry.dividers.get(ring, 1)]
                    if ring != EVENTS_RING and entry.end.get(ring, 0) > entry.begin.get(ring, 0)
                )
                run.trimmed[written.recorder] = had, entry.deleted > 0


def _damage_of(path: Path) -> Sequence[str]:
    if path.suffix == ".silo":
        return damage_of(path)
    if path.suffix == ".csv":
        return damage_of_csv(path)
    return damage_of_bag(path) if path.is_dir() or path.suffix == ".mcap" else ()


def _kept_elements(reader: SegmentReader) -> Sequence[ElementSchema]:
    """The elements that a save would have; all where there are none."""
    elements = reader.schema.elements
    return [element for element in elements if element.info.options.action is not Action.PUBLISH] or elements


def _oldest(reader: SegmentReader, number: int) -> tuple[RingSchema, int]:
    """A ring, and the oldest tick of which it has its row, as far as it is overwritten."""
    ring = reader.schema.rings[number]
    return ring, ring.divider * reader.rows(number, 0, 1).first if ring.buffer_type is BufferType.LOOPING else 0


def verify(folder: Path) -> Verified:
    """Hold all that stands in a log folder against one another. Raises LogNotFoundError, OSError."""
    there = _Folder(folder)
    verdicts = list(there.verdicts)
    runs = sorted(there.runs.values(), key=lambda run: (run.logger, run.started_ns))
    for run in runs:
        verdicts += _recordings(run, _recorded_around(run, runs), there)
        verdicts += _captures(run, there.captures.get(run.logger, []))
        verdicts += _saved(run)
        verdicts += _lost(run)
        verdicts += _events(run, there)
    verdicts += _totals(runs)
    last = {run.logger: run for run in runs}
    named = {one.run for one in verdicts if one.kind == "missing"}
    asked = [one for one in verdicts if one.kind == "not recorded"]
    not_kept = (
        verdict
        for run in runs
        if run.run not in named
        for verdict in _not_kept(run, run.logger in there.gone, last[run.logger] is run)
    )
    return Verified(
        str(folder),
        tuple(map(_covered, runs)),
        tuple(one for one in verdicts if not one.told and one not in asked),
        tuple(one for one in verdicts if one.told and one not in asked),
        (*asked, *not_kept),
        tuple(verdict for run in runs for verdict in _newest(run)),
    )


def _not_kept(run: KnownRun, lacks_files: bool, newest: bool) -> Iterator[Verdict]:
    """The ticks of a run that stand nowhere, as no recording was to have them, and no save had them, or it is gone."""
    kept = [*(span for part in run.parts for span in part.covered()), *(span for _, span, _ in run.saved), *run.held]
    lacks = without([(0, run.ticks - 1)], kept) if run.ticks else []
    for name, (had, by_budget) in run.trimmed.items():
        deleted = without(lacks, without(lacks, had))
        if deleted:
            why = f"recording '{name}' had them, and its budget deleted them, as it is to"
            if not by_budget:
                why = f"recording '{name}' had them, and its parts that did are no longer there"
            text = f"run {run.run}: {spans_text(deleted)} of {many(run.ticks, 'tick')} are in no file: {why}"
            yield Verdict("not kept", text, run.logger, run.run, tuple(deleted))
        lacks = without(lacks, had)
    lacks = without(lacks, run.paused)
    if not run.ended and not run.memory and newest:
        unseen = without(lacks, [(0, max((last for _, last in kept), default=-1))])
        if unseen:
            why = (
                "nothing tells of its end, and no memory of it can be seen from here: it may be another user's, or gone"
            )
            text = f"run {run.run}: {spans_text(unseen)} of {many(run.ticks, 'tick')} are in no file: {why}"
            yield Verdict("not kept", text, run.logger, run.run, tuple(unseen))
            lacks = without(lacks, unseen)
    saved = [span for _, span, _ in run.saved]
    end = max((last + 1 for _, last in [*saved, *run.held]), default=0)  # what came behind was never overwritten
    there = (("saved are", saved), ("in memory are", run.held))
    held = "".join(f"; {what} {spans_text(merged(spans))}" for what, spans in there if spans)
    let_go = "its memory was let go of, and nobody had saved them"
    if run.away:
        let_go = f"they may be in what was saved to another folder, and can't be read there: {and_more(run.away, 3)}"
    for spans, why in (
        (
            without(lacks, [(end, run.ticks)]),
            "buffers keep the newest samples, and these were overwritten, as they are made to be",
        ),
        (without(lacks, [(0, end - 1)]), let_go),
    ):
        if spans:
            of = many(run.ticks, "tick")
            where = f"run {run.run}: {spans_text(spans)} of {of} are in no file, and nothing recorded them"
            gone = ", unless what is gone has them" if lacks_files else ""
            yield Verdict("not kept", f"{where}: {why}{gone}{held}", run.logger, run.run, tuple(spans))


def _newest(run: KnownRun) -> Iterator[Verdict]:
    """The looping elements of which less of a run is there than of others."""
    there = merged([*(span for _, span, _ in run.saved), *run.held])
    recorded = [span for part in run.parts for span in part.covered()]
    shorter: dict[str, list[Span]] = {}
    for name, spans in run.newest.items():
        before = run.dividers[name] - 1  # its first sample: these ticks are of one that it held for no divider
        lacks = without(there, [*((max(0, first - before), last) for first, last in spans), *recorded])
        if sum(last + 1 - first for first, last in lacks) > run.slack:
            shorter[name] = lacks
    if shorter:
        kept = {name: max(run.newest[name], key=lambda span: span[1]) for name in shorter}
        names = [f"{name} the last {many(last + 1 - first, 'tick')}" for name, (first, last) in kept.items()]
        text = f"run {run.run}: looping buffers hold the newest only: {and_more(names, MOST_SHOWN)}"
        ticks = tuple(merged(span for lacks in shorter.values() for span in lacks))
        yield Verdict("newest", text, run.logger, run.run, ticks)


def _covered(run: KnownRun) -> RunCovered:
    recorded = (span for part in run.parts for span in part.ticks())
    saved = (span for _, span, _ in run.saved)
    captured = ((one.offset - len(one.time_ns), one.offset - 1) for _, one in run.captured if len(one.time_ns))
    counts = [sum(last + 1 - first for first, last in merged(some)) for some in (recorded, saved, captured, run.held)]
    return RunCovered(run.logger, run.run, run.ticks, *counts)


# ---------------------------------------------------------------------------------------------------------- recordings


def _recorded_around(run: KnownRun, runs: Iterable[KnownRun]) -> set[str]:
    """The recorders that recorded runs both before and after this one: they were to record it, too."""
    others = [(part.recorder, one.started_ns) for one in runs if one.logger == run.logger for part in one.parts]
    before = {recorder for recorder, started_ns in others if started_ns < run.started_ns}
    after = {recorder for recorder, started_ns in others if started_ns > run.started_ns}
    return before & after if run.started_ns else set()


def _recordings(run: KnownRun, around: set[str], there: _Folder) -> Iterator[Verdict]:
    own = {part.recorder for part in run.parts}
    under_way = {name for logger, name in there.orders if logger == run.logger and _was_to_have(run, name, there)}
    over = {name for name in around if _is_under_way(run, name, there) is False}
    for name in sorted(((around - over) | under_way) - own):
        lacks = without([(0, run.ticks - 1)], run.memory) if run.ticks else []
        if lacks:
            yield _missing(run, name, lacks)
    for name in sorted(own):
        parts = [part for part in run.parts if part.recorder == name]
        yield from _recording(run, name, parts, there)


def _was_to_have(run: KnownRun, name: str, there: _Folder) -> bool:
    """Whether a recording was to have all of a run of which it has no part, nor ever made room of one.

    It was under way when the run began, and was not ended in it by somebody who may have come before its first tick.
    """
    if (run.logger, name) in there.elsewhere or not _is_under_way(run, name, there) or not run.ended:
        return False
    if any(_is_end(event) for event, begun in there.orders[run.logger, name] if event.run == run.run and not begun):
        return False
    numbers = [part.number for one in there.runs.values() for part in one.parts if part.recorder == name]
    return not numbers or min(numbers) == 1


def _is_under_way(run: KnownRun, name: str, there: _Folder) -> bool | None:
    """Whether a recording was under way when a run began; None where the event log doesn't tell.

    One ends with its program, though that may be told after the start of the next one, which finds what it left.
    """
    orders = there.orders.get((run.logger, name), [])
    before = [at for at, (event, _) in enumerate(orders) if event.number < run.started]
    if not before:
        return None
    _, begun = orders[before[-1]]
    ended_in = next((there.runs.get(event.run) for event, begins in orders[before[-1] + 1 :] if not begins), None)
    return begun and (ended_in is None or ended_in.started >= run.started)


def _is_end(event: LoggedEvent) -> bool:
    """Whether somebody ended a recording: otherwise it was to have its run to the end."""
    return CLOSED not in event.text and event.kind != EventKind.RECORDING_FAILED.value


def _stops(run: KnownRun, name: str, there: _Folder) -> list[tuple[LoggedEvent, LoggedEvent | None]]:
    """The events by which somebody ended a recording in a run, each with the one that tells of its next begin there."""
    orders = [(event, begun) for event, begun in there.orders.get((run.logger, name), ()) if event.run == run.run]
    following = [*(event if begun else None for event, begun in orders[1:]), None]
    return [
        (event, after) for (event, begun), after in zip(orders, following, strict=False) if not begun and _is_end(event)
    ]


def _is_from_begin(run: KnownRun, name: str, parts: list[ScannedPart], there: _Folder) -> bool:
    """Whether a recording was under way when the run began, and none of its parts went for newer ones since."""
    numbers = {part.number for one in there.runs.values() for part in one.parts if part.recorder == name}
    first = min(part.number for part in parts)
    return bool(_is_under_way(run, name, there)) and (first == 1 or first - 1 in numbers)


def _recording(run: KnownRun, name: str, parts: list[ScannedPart], there: _Folder) -> Iterator[Verdict]:
    missing: list[Span] = []
    paused: list[Span] = []
    again: list[Span] = []
    rings = {ring.ring: ring for part in parts if part.scan.facts for ring in part.scan.facts.value_rings}
    first_part = min(parts, key=lambda part: part.number).scan.facts
    at_first = {ring.ring for ring in first_part.value_rings} if first_part is not None else rings.keys()
    # one that was ended in this run by somebody has what it has, and so have buffers that are full
    full = any(_FULL in event.text and f"'{name}'" in event.text for event in run.events)
    stops = _stops(run, name, there)
    ended = full or any(after is None for _, after in stops)
    lost = [found for event in run.events if (found := _LOST_AT.match(event.text)) is not None]
    last_lost = max((int(found["last"]) for found in lost if found["name"] == name), default=-1)
    pauses = [(stop.tick, after.tick) for stop, after in stops if after is not None]
    for number, ring in rings.items():
        rows = [(first, end - 1) for part in parts for first, end in part.scan.rows.get(number, ())]
        begins = [one.begin for part in parts if part.scan.facts for one in part.scan.facts.rings if one.ring == number]
        if number in at_first and _is_from_begin(run, name, parts, there):  # not derived since
            begins.append(0)
        end = max([0, *(last + 1 for _, last in rows)])
        if run.ended and not ended:
            end = max(end, -(-run.ticks // ring.divider))
        if last_lost >= 0 and rows:  # told behind its last row: it was to have them
            end = max(end, last_lost // ring.divider + 1)
        memory = [(-(-first // ring.divider), last // ring.divider) for first, last in run.memory]
        lacks = without([(min(begins), end - 1)], [*rows, *memory]) if end > min(begins) else []
        # parts of another order don't go on from those before them
        chosen = [(first, last) for first, last in lacks if last + 1 in begins and _meets((first, last), pauses, ring)]
        lacks = without(lacks, chosen)
        paused += [(first * ring.divider, last * ring.divider) for first, last in chosen]
        missing += [(first * ring.divider, last * ring.divider) for first, last in lacks]
        samples = len(ring.channels) * sum(last + 1 - first for first, last in lacks)
        run.lacks[name] = run.lacks.get(name, 0) + samples
        again += [(first * ring.divider, last * ring.divider) for first, last in doubled(rows)]
    if missing:
        yield _missing(run, name, merged(missing))
    if paused:
        spans = merged(paused)
        run.paused += spans
        told = ", ".join(f"{stop.number} and {after.number}" for stop, after in stops if after is not None)
        of = many(run.ticks, "tick")
        text = f"recording '{name}': {spans_text(spans)} of run {run.run}, of {of}, were not recorded: "
        text += f"it was stopped then, and begun again (events {told})"
        yield Verdict("not recorded", text, run.logger, run.run, tuple(spans))
    if again:
        spans = merged(again)
        text = f"recording '{name}': {spans_text(spans)} of run {run.run} stand in two parts"
        yield Verdict("twice", text, run.logger, run.run, tuple(spans))


def _meets(rows: Span, pauses: Iterable[Span], ring: RingFacts) -> bool:
    """Whether rows lack that were to come in a pause: an end is told after the last row, a begin after the first."""
    first, last = rows[0] - 1, rows[1] + 1
    return any(first * ring.divider <= stop <= last * ring.divider <= begun + ring.divider for stop, begun in pauses)


def _missing(run: KnownRun, name: str, spans: list[Span]) -> Verdict:
    text = f"recording '{name}': {spans_text(spans)} of run {run.run}, of {many(run.ticks, 'tick')}, are in no part"
    return Verdict("missing", text, run.logger, run.run, tuple(spans), run.told([f"'{name}'", "recording", "recorder"]))


def _totals(runs: Iterable[KnownRun]) -> Iterator[Verdict]:
    """What the event log told last of each recording, and what its parts have, where these are all there."""
    told: dict[tuple[str, str], tuple[LoggedEvent, list[int]]] = {}
    where: Counter[tuple[str, str]] = Counter()
    lacks: Counter[tuple[str, str]] = Counter()
    parts: dict[tuple[str, str], list[PartScan]] = {}
    for run in runs:
        lacks.update({(run.logger, name): samples for name, samples in run.lacks.items()})
        for part in run.parts:
            parts.setdefault((run.logger, part.recorder), []).append(part.scan)
        for event in run.events:
            if (found := _LOST_AT.match(event.text)) is not None:
                where[run.logger, found["name"]] += int(found["lost"])
            elif (found := _TOTALS.match(event.text)) is not None and "stays in memory" not in event.text:
                counts = [int(found[what].replace(" ", "")) for what in ("parts", "samples", "lost")]
                told[run.logger, found["name"]] = event, counts
    for (logger, name), (event, (count_of_parts, samples, lost)) in told.items():
        scans = parts.get((logger, name), [])
        if len(scans) != count_of_parts:
            continue  # of other orders too, or some were taken away
        there = sum(scan.facts.samples(scan.counts) for scan in scans if scan.facts is not None)
        number, missing = event.number, lacks[logger, name]
        text = ""
        if there != samples:
            text = f"{samples} samples were told (event {number}), its parts have {there}"
        elif _UNCOUNTED.search(event.text):
            continue  # how much that was nobody could count
        elif lost < missing:
            text = f"{lost} samples were told to be lost (event {number}), and {missing} are in no part"
        elif lost > max(missing, where[logger, name]):
            known = max(missing, where[logger, name])
            text = f"{lost} samples were told to be lost (event {number}), and of {known} alone is known where"
        if text:
            yield Verdict("disagrees", f"recording '{name}': {text}", logger, event.run)


# ------------------------------------------------------------------------------------------------------------ captures


def _captures(run: KnownRun, listed: list[CaptureEntry]) -> Iterator[Verdict]:
    fires = Counter(
        (recording.conditions.capture.trigger, fire)
        for _, recording in run.captured
        if recording.conditions.capture is not None
        for fire in recording.conditions.capture.fires
    )
    for (trigger, fire), times in fires.items():
        if times > 1:
            text = f"trigger '{trigger}' fired once at tick {fire} of run {run.run}, and {times} captures have it"
            yield Verdict("twice", text, run.logger, run.run, ((fire, fire),))
    captured = [(one.offset - len(one.time_ns), one.offset - 1) for _, one in run.captured if len(one.time_ns)]
    recorded = [span for part in run.parts for span in part.covered()]
    there = merged([*captured, *recorded, *(span for _, span, _ in run.saved)])
    for _, recording in run.captured:
        facts = recording.conditions.capture
        if facts is not None and (lacks := without([(facts.first, min(facts.last, run.ticks - 1))], there)):
            text = f"capture {facts.number} of '{facts.trigger}': {spans_text(lacks)} of run {run.run} are in no file"
            yield Verdict("missing", text, run.logger, run.run, tuple(lacks), facts.ended and f"it says: {facts.ended}")
    yield from _fires(run, fires)
    begun = [entry for entry in listed if entry.run == run.run and not entry.files and run.ended]
    for trigger in dict.fromkeys(entry.trigger for entry in begun):
        numbers = [str(entry.number) for entry in begun if entry.trigger == trigger]
        which = and_more(numbers, MOST_SHOWN)
        nouns = ("captures", "were") if len(numbers) > 1 else ("capture", "was")
        text = f"{nouns[0]} {which} of '{trigger}' in run {run.run} {nouns[1]} begun and never written"
        yield Verdict("missing", text, run.logger, run.run, told=run.told([f"'{trigger}'"]))


def _fires(run: KnownRun, fires: Mapping[tuple[str, int], int]) -> Iterator[Verdict]:
    """The fires that were told, and that no capture has, and those that were told twice."""
    written = [(found["name"], int(found["first"]), int(found["last"])) for event in run.events
               if event.kind == EventKind.CAPTURED.value and (found := _CAPTURED.match(event.text))]  # fmt: skip
    told: Counter[tuple[str, int]] = Counter()
    uncaptured: dict[str, list[int]] = {}
    for event in run.events:
        found = _FIRED.match(event.text) if event.kind == EventKind.TRIGGERED.value else None
        if found is None or " times, " in event.text:
            continue
        name = found["name"]
        told[name, event.tick] += 1
        if fires.get((name, event.tick)) or any(
            name == one and first <= event.tick <= last for one, first, last in written
        ):  # one that is gone was taken away by somebody, or as it keeps no more
            continue
        uncaptured.setdefault(name, []).append(event.tick)
    for name, ticks in uncaptured.items():
        about = run.told([f"'{name}'", "triggers"])
        if not about and not run.ended:
            continue  # it may be under way
        places = and_more([str(tick) for tick in ticks], MOST_SHOWN)
        when = f"at tick {places} of run {run.run}, and no capture has it"
        if len(ticks) > 1:
            when = f"{len(ticks)} times in run {run.run} of which no capture has anything, at ticks {places}"
        spans = tuple((tick, tick) for tick in ticks)
        yield Verdict("missing", f"trigger '{name}' fired {when}", run.logger, run.run, spans, about)
    for (name, tick), times in told.items():
        if times > 1:
            text = f"trigger '{name}' is told {times} times to have fired at tick {tick} of run {run.run}"
            yield Verdict("twice", text, run.logger, run.run, ((tick, tick),))


# --------------------------------------------------------------------------------------------------- logs, event log


def _saved(run: KnownRun) -> Iterator[Verdict]:
    again = [path.name for path, _, why in run.saved if why in _DIED]
    if len(again) > 1:
        text = f"what the program of run {run.run} left was saved {len(again)} times: {', '.join(again)}"
        yield Verdict("twice", text, run.logger, run.run)


def _lost(run: KnownRun) -> Iterator[Verdict]:
    """What buffers had no room for."""
    counts: Counter[str] = Counter()
    for (_, name), samples in run.lost.items():
        counts[name] += samples
    if counts:
        names = and_more([f"{count(samples)} of {name}" for name, samples in counts.items()], MOST_SHOWN)
        lost = many(counts.total(), "sample")
        text = f"run {run.run}, of {many(run.ticks, 'tick')}: {lost} had no room in a buffer: {names}"
        yield Verdict("missing", text, run.logger, run.run, told=run.told(["samples could not be kept"]))


def _events(run: KnownRun, there: _Folder) -> Iterator[Verdict]:
    kinds = Counter(event.kind for event in run.events)
    # of what comes from a helper process, which tells of starts; what is older than the log is in none
    oldest_ns = min((event.time_ns for one in there.runs.values() for event in one.events if one.logger == run.logger),
                    default=0)  # fmt: skip
    known = (run.parts or run.captured) and run.logger in there.loggers and run.started_ns >= oldest_ns > 0
    if known and not kinds[EventKind.STARTED.value]:
        text = f"run {run.run} was recorded or captured, and the event log doesn't say that it was started"
        yield Verdict("missing", text, run.logger, run.run)
