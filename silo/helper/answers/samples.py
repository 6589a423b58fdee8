"""Samples that the buffers hold: columns, rows, streams, pins."""

from silo.helper.answers.table import Parts, answers_to
from silo.helper.history import check_history, history
from silo.helper.pins import no_pin
from silo.helper.samples import check_samples, samples
from silo.ipc.messages import (
    ClosePin,
    CloseStream,
    Columns,
    Done,
    GetHistory,
    GetSamples,
    KeepPin,
    OpenPin,
    OpenStream,
    PinOpened,
    Refused,
    SampleRows,
    StreamOpened,
)


@answers_to(GetHistory)
def _history(parts: Parts, request: GetHistory) -> Columns | Refused:
    pinned = parts.pins.rows(request.pin) if request.pin else None
    if isinstance(pinned, Refused):
        return pinned
    return check_history(request) or history(request, parts.mirror.now, parts.mirror.open_watcher(), pinned)


@answers_to(GetSamples)
def _samples(parts: Parts, request: GetSamples) -> SampleRows | Refused:
    source = parts.pins.rows(request.pin) if request.pin else parts.mirror.open_watcher()
    if isinstance(source, Refused):
        return source
    return check_samples(request) or samples(request, parts.mirror.now, source)


@answers_to(OpenStream)
def _open_stream(parts: Parts, request: OpenStream) -> StreamOpened | Refused:
    return parts.publisher.streams.open(request)


@answers_to(CloseStream)
def _close_stream(parts: Parts, request: CloseStream) -> Done | Refused:
    return parts.publisher.streams.close_for(request.stream, request.proof)


@answers_to(OpenPin)
def _open_pin(parts: Parts, request: OpenPin) -> PinOpened | Refused:
    return parts.pins.open(request, parts.mirror.now, parts.mirror.open_watcher())


@answers_to(KeepPin)
def _keep_pin(parts: Parts, request: KeepPin) -> Done | Refused:
    return Done("kept") if parts.pins.keep(request.pin) else no_pin(request.pin)


@answers_to(ClosePin)
def _close_pin(parts: Parts, request: ClosePin) -> Done:
    parts.pins.close(request.pin)
    return Done("the pin is closed")
