"""Endless recordings."""

from silo.helper.answers.table import Parts, answers_to, must_live, signed
from silo.helper.lanes import Lane
from silo.ipc.messages import Done, ListRecorders, Recorders, RecorderStarted, Refused, StartRecorder, StopRecorder


@answers_to(ListRecorders)
def _list_recorders(parts: Parts, _: ListRecorders) -> Recorders:
    return Recorders(parts.recording.infos())


@answers_to(StartRecorder, lane=Lane.RECORDERS)
def _start_recorder(parts: Parts, request: StartRecorder) -> RecorderStarted | Refused:
    return must_live(parts.mirror.now) or parts.recording.begin(signed(request), left_s=parts.turn.left_s)


@answers_to(StopRecorder, lane=Lane.RECORDERS)
def _stop_recorder(parts: Parts, request: StopRecorder) -> Done | Refused:
    return parts.recording.end(signed(request), left_s=parts.turn.left_s)
