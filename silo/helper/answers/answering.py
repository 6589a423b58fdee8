"""Answers a request with the function of the table, and says what went wrong."""

import dataclasses
from typing import Any

import msgspec

from silo.errors import ElementError, SaveError, ScriptError, SegmentError
from silo.helper import script_folder
from silo.helper.answers.table import HANDLERS, Parts
from silo.helper.events import Events
from silo.helper.judge import Judge
from silo.helper.lanes import Turn
from silo.helper.mirror import Mirror
from silo.helper.operators import Operators
from silo.helper.publisher import Publisher
from silo.helper.recorders import Recording
from silo.helper.recordings import RecordingFolder, RecordingRefusedError
from silo.helper.robot import Robot, ending
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc.messages import AnyReply, GoesOn, Refused, RefusedWhy, Request
from silo.ipc.published import EventKind

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
            publisher.pins,
            RecordingFolder(),
            Surveyor(mirror),
            operators,
        )

    def stop(self) -> None:
        """End what goes on by itself."""
        self._parts.surveyor.stop()

    def answer(self, request: Request[Any], turn: Turn | None = None) -> bytes:
        """Return the encoded answer."""
        reply = self.reply(request, turn)
        return reply if isinstance(reply, bytes) else _encoder.encode(reply)

    def reply(self, request: Request[Any] | Refused, turn: Turn | None = None) -> AnyReply | bytes:
        """Return the answer, or its bytes; waits for the robot process where it must, while the `turn` has time."""
        if isinstance(request, Refused):
            return request
        parts = self._parts if turn is None else dataclasses.replace(self._parts, turn=turn)
        try:
            reply: AnyReply | bytes = HANDLERS[type(request)](parts, request)
        except (script_folder.ScriptRefusedError, RecordingRefusedError) as error:
            return error.refused
        except (ScriptError, SaveError, ElementError) as error:
            return Refused(RefusedWhy.INVALID, str(error))
        except SegmentError as error:
            return Refused(RefusedWhy.FAILED, str(error))
        return reply

    def number(self) -> int:
        """Return a number by which an event can tell how a request ended."""
        return self._parts.robot.number()

    def tell_end(self, job: int, request: Request[Any], reply: AnyReply | bytes, by: str) -> None:
        """Tell all how a request ended whose client was told that it goes on."""
        if not isinstance(reply, bytes | GoesOn):
            self._parts.events.publish(EventKind.ENDED, ending(request, reply), by=by, job=job)
