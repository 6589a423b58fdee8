"""Answers a request with the function of the table, and says what went wrong."""

from typing import Any

import msgspec

from silo.errors import ElementError, SaveError, ScriptError, SegmentError
from silo.helper import script_folder
from silo.helper.answers.table import HANDLERS, Parts
from silo.helper.events import Events
from silo.helper.judge import Judge
from silo.helper.mirror import Mirror
from silo.helper.operators import Operators
from silo.helper.pins import Pins
from silo.helper.publisher import Publisher
from silo.helper.recorders import Recording
from silo.helper.recordings import RecordingFolder, RecordingRefusedError
from silo.helper.robot import Robot
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc.messages import AnyReply, Refused, RefusedWhy, Request

_encoder = msgspec.msgpack.Encoder()


class Answers:
    """Answers requests with everything that the helper has."""

    def __init__(
        self,
        mirror: Mirror,
        events: Events,
        publisher: Publisher,
        saver: Saver,
        robot: Robot,
        judge: Judge,
        recording: Recording,
        operators: Operators,
    ) -> None:
        self._parts = Parts(
            mirror,
            events,
            publisher,
            saver,
            robot,
            judge,
            recording,
            Pins(),
            RecordingFolder(),
            Surveyor(mirror),
            operators,
        )

    def stop(self) -> None:
        """End what goes on by itself."""
        self._parts.surveyor.stop()

    def answer(self, request: Request[Any]) -> bytes:
        """Return the encoded answer; waits for the robot process where it must."""
        reply: AnyReply | bytes
        try:
            reply = HANDLERS[type(request)](self._parts, request)
        except (script_folder.ScriptRefusedError, RecordingRefusedError) as error:
            reply = error.refused
        except (ScriptError, SaveError, ElementError) as error:
            reply = Refused(RefusedWhy.INVALID, str(error))
        except SegmentError as error:
            reply = Refused(RefusedWhy.FAILED, str(error))
        return reply if isinstance(reply, bytes) else _encoder.encode(reply)
