"""Saving, and the recordings in the logger's own folder."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from silo.recordings import requests
from silo.recordings.folder import RecordingFolder
from silo.recordings.requests import GetPiece, Piece, RecordingParts, Recordings, Save, SaveStarted
from silo.rpc.published import EventKind
from silo.rpc.serving import Server, Turn
from silo.state.events import EventNotifier
from silo.state.replica import Replica


@dataclass(frozen=True)
class RecordingServer(Server, does=[requests]):
    """Begins to save, and reads and deletes what was."""

    folder: RecordingFolder
    begin: Callable[[Save], SaveStarted]  # to save; the rest comes as events
    replica: Replica
    events: EventNotifier

    def save(self, turn: Turn, request: Save) -> SaveStarted:
        return self.begin(msgspec.structs.replace(request, client=turn.by))

    def recordings(self, most: int) -> Recordings:
        robot = self.replica.now.robot
        return self.folder.listing(robot.folder, robot.logger, most)

    def parts_of(self, name: str) -> RecordingParts:
        return self.folder.parts(self.replica.now.robot.folder, name)

    def get_piece(self, request: GetPiece) -> Piece:
        return self.folder.piece(self.replica.now.robot.folder, request)

    def delete_recording(self, turn: Turn, name: str) -> str:
        robot = self.replica.now.robot
        text = self.folder.delete(robot.folder, robot.logger, name)
        self.events.publish(EventKind.DELETED, text, by=turn.by)
        return text
