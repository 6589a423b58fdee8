"""The servers of all features, with what each needs of the helper process."""

from typing import Any

from silo.conditions.monitor import Judge
from silo.conditions.server import ConditionServer
from silo.control.server import ControlLock, ControlServer
from silo.helper.robot_link import RobotLink, ending
from silo.helper.saver import Saver
from silo.history.server import HistoryServer
from silo.live.publisher import Publisher
from silo.live.server import LiveServer
from silo.live.statistics import Surveyor
from silo.parameters.server import ParameterServer
from silo.recorder.server import EndlessRecordings, RecorderServer
from silo.recordings.folder import RecordingFolder
from silo.recordings.server import RecordingServer
from silo.rpc.declaring import GoesOn, Request
from silo.rpc.published import EventKind
from silo.rpc.serving import Answer, Dispatch
from silo.scripts.server import ScriptServer
from silo.state.events import EventNotifier
from silo.state.replica import Replica
from silo.state.robot_program import RobotProgram
from silo.state.server import Outside, StateServer


class Servers(Dispatch):
    """Has each request done by the server of its feature, or by the robot program."""

    def __init__(
        self,
        replica: Replica,
        events: EventNotifier,
        publisher: Publisher,
        saver: Saver,
        robot: RobotLink,
        judge: Judge,
        recording: EndlessRecordings,
        control_lock: ControlLock,
    ) -> None:
        self._robot, self._events, self._surveyor = robot, events, Surveyor(replica)
        program = RobotProgram(replica, robot.ask)
        outside = Outside(publisher.name_client, publisher.summary.now, control_lock.closed)
        servers = (
            StateServer(replica, events, program, outside),
            ScriptServer(replica, events, program),
            ControlServer(control_lock),
            ConditionServer(judge, replica, events, program),
            HistoryServer(replica, publisher.pins, publisher.streams),
            LiveServer(publisher, self._surveyor),
            RecordingServer(RecordingFolder(), saver, replica, events),
            RecorderServer(recording, program),
            ParameterServer(program),
        )
        super().__init__(servers, program.reply)

    def stop(self) -> None:
        """End what goes on by itself."""
        self._surveyor.stop()

    def number(self) -> int:
        """Return a number by which an event can tell how a request ended."""
        return self._robot.number()

    def tell_end(self, job: int, request: Request[Any], reply: Answer, by: str) -> None:
        """Tell all how a request ended whose client was told that it goes on."""
        if not isinstance(reply, bytes | GoesOn):
            self._events.publish(EventKind.ENDED, ending(request, reply), by=by, job=job)
