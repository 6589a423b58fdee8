"""Saving, the recordings in the logger's own folder, and endless recordings."""

import msgspec

from silo.helper.servers.parts import Parts, must_live
from silo.recordings import requests as recordings
from silo.recordings.requests import (
    GetPiece,
    Piece,
    Recorders,
    RecorderStarted,
    RecordingParts,
    Recordings,
    Save,
    SaveStarted,
    StartRecorder,
    StopRecorder,
)
from silo.rpc.published import EventKind
from silo.rpc.serving import Server, Turn


class RecordingServer(Server[Parts], does=[recordings]):
    """Begins to save and to record, and reads and deletes what was."""

    def save(self, turn: Turn, request: Save) -> SaveStarted:
        return self.state.saver.save(msgspec.structs.replace(request, client=turn.by))

    def recordings(self, most: int) -> Recordings:
        robot = self.state.replica.now.robot
        return self.state.recordings.listing(robot.folder, robot.logger, most)

    def parts_of(self, name: str) -> RecordingParts:
        return self.state.recordings.parts(self.state.replica.now.robot.folder, name)

    def get_piece(self, request: GetPiece) -> Piece:
        return self.state.recordings.piece(self.state.replica.now.robot.folder, request)

    def delete_recording(self, turn: Turn, name: str) -> str:
        robot = self.state.replica.now.robot
        text = self.state.recordings.delete(robot.folder, robot.logger, name)
        self.state.events.publish(EventKind.DELETED, text, by=turn.by)
        return text

    def list_recorders(self) -> Recorders:
        return Recorders(self.state.recording.infos())

    def start_recorder(self, turn: Turn, request: StartRecorder) -> RecorderStarted:
        must_live(self.state.replica.now)
        return self.state.recording.begin(msgspec.structs.replace(request, client=turn.by), left_s=turn.left_s)

    def stop_recorder(self, turn: Turn, request: StopRecorder) -> str:
        return self.state.recording.end(msgspec.structs.replace(request, client=turn.by), left_s=turn.left_s)
