"""Endless recordings."""

from silo.helper.answers.table import Parts, answers_to, must_live, signed
from silo.ipc.messages import Done, ListRecorders, Recorders, RecorderStarted, Refused, StartRecorder, StopRecorder


@answers_to(ListRecorders)
def _list_recorders(parts: Parts, _: ListRecorders) -> Recorders:
    return Recorders(parts.recording.infos())


@answers_to(StartRecorder)
def _start_recorder(parts: Parts, request: StartRecorder) -> RecorderStarted | Refused:
    return must_live(parts.mirror.now) or parts.recording.begin(signed(request))


@answers_to(StopRecorder)
def _stop_recorder(parts: Parts, request: StopRecorder) -> Done | Refused:
    return parts.recording.end(signed(request))
