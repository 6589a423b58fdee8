"""Saved files: saving, and the recordings in the logger's own folder."""

from silo.helper.answers.table import Parts, answers_to, signed
from silo.helper.lanes import Lane
from silo.ipc.messages import (
    DeleteRecording,
    Done,
    GetParts,
    GetPiece,
    ListRecordings,
    Piece,
    RecordingParts,
    Recordings,
    Refused,
    Save,
    SaveStarted,
)
from silo.ipc.published import EventKind


@answers_to(Save)
def _save(parts: Parts, request: Save) -> SaveStarted | Refused:
    return parts.saver.save(signed(request))


@answers_to(ListRecordings)
def _list_recordings(parts: Parts, request: ListRecordings) -> Recordings:
    robot = parts.mirror.now.robot
    return parts.recordings.listing(robot.folder, robot.logger, request.most)


@answers_to(GetParts)
def _parts(parts: Parts, request: GetParts) -> RecordingParts:
    return parts.recordings.parts(parts.mirror.now.robot.folder, request.name)


@answers_to(GetPiece)
def _piece(parts: Parts, request: GetPiece) -> Piece:
    return parts.recordings.piece(parts.mirror.now.robot.folder, request)


@answers_to(DeleteRecording, lane=Lane.DISK)
def _delete_recording(parts: Parts, request: DeleteRecording) -> Done:
    robot = parts.mirror.now.robot
    text = parts.recordings.delete(robot.folder, robot.logger, request.name)
    parts.events.publish(EventKind.DELETED, text, by=request.client)
    return Done(text)
