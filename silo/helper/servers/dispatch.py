"""Has requests done by the servers of their features."""

from typing import Any

from silo.conditions.monitor import Judge
from silo.control.lock import ControlLock
from silo.helper.robot_link import RobotLink, ending
from silo.helper.saver import Saver
from silo.helper.servers.conditions import ConditionServer
from silo.helper.servers.control import ControlServer
from silo.helper.servers.live import LiveServer
from silo.helper.servers.parts import Parts, relayed
from silo.helper.servers.recorded import RecordingServer
from silo.helper.servers.scripts import TableServer
from silo.live.publisher import Publisher
from silo.live.statistics import Surveyor
from silo.recorder.server import EndlessRecordings
from silo.recordings.folder import RecordingFolder
from silo.rpc.declaring import GoesOn, Request
from silo.rpc.published import EventKind
from silo.rpc.serving import Answer, Dispatch, Turn
from silo.state.events import EventNotifier
from silo.state.replica import Replica

SERVERS = (TableServer, LiveServer, RecordingServer, ConditionServer, ControlServer)
NOBODY = Turn()


class Answers:
    """Answers requests with everything that the helper has."""

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
        self._parts = Parts(
            replica,
            events,
            publisher,
            saver,
            robot,
            judge,
            recording,
            publisher.pins,
            RecordingFolder(),
            Surveyor(replica),
            control_lock,
        )
        servers = [server(self._parts) for server in SERVERS]
        self._dispatch = Dispatch(servers, lambda request, turn: relayed(self._parts, request, turn))

    def stop(self) -> None:
        """End what goes on by itself."""
        self._parts.surveyor.stop()

    def reply(self, request: Request[Any], turn: Turn = NOBODY) -> Answer:
        """Return the answer, or its bytes; waits for the robot process where it must, while the `turn` has time.

        Raises what refuses it; `silo.rpc.refusals.answered` has the words for it.
        """
        return self._dispatch(request, turn)

    def number(self) -> int:
        """Return a number by which an event can tell how a request ended."""
        return self._parts.robot.number()

    def tell_end(self, job: int, request: Request[Any], reply: Answer, by: str) -> None:
        """Tell all how a request ended whose client was told that it goes on."""
        if not isinstance(reply, bytes | GoesOn):
            self._parts.events.publish(EventKind.ENDED, ending(request, reply), by=by, job=job)
