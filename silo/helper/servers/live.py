"""What clients look at: views and streams as it happens, samples that are held, the event log."""

from collections.abc import Sequence

from silo import requests as messages
from silo.helper.servers.parts import Parts
from silo.history import requests as sample_requests
from silo.history import search_requests as moment_requests
from silo.history.history import check_history, history
from silo.history.pinned_rows import PinnedRows
from silo.history.requests import (
    ClosePin,
    CloseStream,
    Columns,
    GetHistory,
    GetSamples,
    KeepPin,
    OpenPin,
    OpenStream,
    PinOpened,
    SampleRows,
    StreamOpened,
)
from silo.history.samples import check_samples, samples
from silo.history.search import check_moments, check_span, find_moments, measure_span
from silo.history.search_requests import FindMoments, MeasureSpan, MomentsFound, SpanMeasured
from silo.live import requests as view_requests
from silo.live.requests import CloseView, GetSurvey, OpenView, Survey, ViewOpened
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.state import event_requests
from silo.state.event_requests import Marked
from silo.state.events import plain

MOST_EVENTS_AT_ONCE = 10_000
MOST_MARK_LETTERS = 200
WRITTEN_S = 0.5  # a disk that takes longer holds no client up


class LiveServer(Server[Parts], does=[view_requests, sample_requests, moment_requests, event_requests]):
    """Answers what is held, and opens what is sent from now on."""

    def open_view(self, request: OpenView) -> ViewOpened:
        return self.state.publisher.open_view(request)

    def close_view(self, request: CloseView) -> str:
        return self.state.publisher.views.close_for(request.view, request.proof)

    def get_survey(self, request: GetSurvey) -> Survey:
        return self.state.surveyor.answer(request)

    def open_stream(self, request: OpenStream) -> StreamOpened:
        return self.state.publisher.streams.open(request)

    def close_stream(self, request: CloseStream) -> str:
        return self.state.publisher.streams.close_for(request.stream, request.proof)

    def open_pin(self, request: OpenPin) -> PinOpened:
        return self.state.pins.open(request, self.state.replica.now, self.state.replica.open_watcher())

    def keep_pin(self, request: KeepPin) -> str:
        self.state.pins.keep(request.pin)
        return "kept"

    def close_pin(self, request: ClosePin) -> str:
        self.state.pins.close(request.pin)
        return "the pin is closed"

    def get_history(self, request: GetHistory) -> Columns:
        pinned = self.state.pins.rows(request.pin) if request.pin else None
        check_history(request)
        return history(request, self.state.replica.now, self.state.replica.open_watcher(), pinned)

    def get_samples(self, request: GetSamples) -> SampleRows:
        source = self.state.pins.rows(request.pin) if request.pin else self.state.replica.open_watcher()
        check_samples(request)
        return samples(request, self.state.replica.now, source)

    def find_moments(self, request: FindMoments) -> MomentsFound:
        check_moments(request)
        pinned = self._pinned(request.pins)
        return find_moments(request, self.state.replica.now, self.state.replica.open_watcher(), pinned)

    def measure_span(self, request: MeasureSpan) -> SpanMeasured:
        check_span(request)
        pinned = self._pinned(request.pins)
        return measure_span(request, self.state.replica.now, self.state.replica.open_watcher(), pinned)

    def _pinned(self, pins: Sequence[str]) -> list[PinnedRows]:
        return [found for pin in pins if (found := self.state.pins.rows(pin)) is not None]

    def get_events(self, since: int, limit: int) -> messages.Events:
        if not 0 <= limit <= MOST_EVENTS_AT_ONCE:
            text = f"the limit of events must be 0 to {MOST_EVENTS_AT_ONCE}, got {limit}"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        return messages.Events(*self.state.events.log.since(since, limit))

    def add_mark(self, turn: Turn, text: str, tick: int, at_ns: int) -> Marked:
        events, replica = self.state.events, self.state.replica
        words = plain(text, MOST_MARK_LETTERS).strip()
        status = replica.status()
        problem, meant = "", tick if tick >= 0 else None
        if not words:
            problem = "a mark needs some words"
        elif not -1 <= tick < max(status.ticks, 0):
            there = f"0 to {status.ticks - 1}" if status.ticks else "none yet"
            problem = f"there is no tick {tick} (ticks: {there})"
        elif at_ns and (meant := replica.tick_at(at_ns)) < 0:
            problem = "no tick of that time is held any more"
        if problem:
            raise RequestRefusedError(RefusedWhy.INVALID, f"{problem}; nothing was marked")
        mark = events.publish(EventKind.MARKER, words, by=turn.by, tick=meant)
        events.log.wait_written(mark.number, WRITTEN_S)  # what was answered outlives a kill of this process
        return Marked(mark)
