"""Samples that are held: as columns, as rows, in pins; moments and facts in them. And streams of what comes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from silo.history import requests, search_requests
from silo.history.history import check_history, history
from silo.history.picking import PinnedRows
from silo.history.pins import Pins
from silo.history.samples import check_samples, samples
from silo.history.search import check_moments, check_span, find_moments, measure_span
from silo.rpc.serving import Server
from silo.state.replica import Replica


@dataclass(frozen=True)
class HistoryServer(Server, does=[requests, search_requests]):
    """Answers what is held, and opens what is sent from now on."""

    replica: Replica
    pins: Pins
    open_or_renew: Callable[[requests.OpenStream], requests.StreamOpened]
    close_for: Callable[[str, str], str]  # by name and proof

    def open_stream(self, request: requests.OpenStream) -> requests.StreamOpened:
        return self.open_or_renew(request)

    def close_stream(self, request: requests.CloseStream) -> str:
        return self.close_for(request.stream, request.proof)

    def open_pin(self, request: requests.OpenPin) -> requests.PinOpened:
        return self.pins.open(request, self.replica.now, self.replica.open_watcher())

    def keep_pin(self, request: requests.KeepPin) -> str:
        self.pins.keep(request.pin)
        return "kept"

    def close_pin(self, request: requests.ClosePin) -> str:
        self.pins.drop(request.pin)
        return "the pin is closed"

    def get_history(self, request: requests.GetHistory) -> requests.Columns:
        pinned = self.pins.rows(request.pin) if request.pin else None
        check_history(request)
        return history(request, self.replica.now, None if request.pin else self.replica.open_watcher(), pinned)

    def get_samples(self, request: requests.GetSamples) -> requests.SampleRows:
        source = self.pins.rows(request.pin) if request.pin else self.replica.open_watcher()
        check_samples(request)
        return samples(request, self.replica.now, source)

    def find_moments(self, request: search_requests.FindMoments) -> search_requests.MomentsFound:
        check_moments(request)
        pinned = self._pinned(request.pins)
        return find_moments(request, self.replica.now, self.replica.open_watcher(), pinned)

    def measure_span(self, request: search_requests.MeasureSpan) -> search_requests.SpanMeasured:
        check_span(request)
        pinned = self._pinned(request.pins)
        return measure_span(request, self.replica.now, self.replica.open_watcher(), pinned)

    def _pinned(self, pins: Sequence[str]) -> list[PinnedRows]:
        return [found for pin in pins if (found := self.pins.rows(pin)) is not None]
