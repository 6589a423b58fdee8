"""The robot program, as servers in the helper process have it do what it alone can."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from silo.core.elements import State
from silo.rpc.declaring import Reply, ReplyT, Request
from silo.rpc.refusals import RefusedWhy, RequestRefusedError, checked, raised
from silo.rpc.serving import Turn
from silo.state.replica import Replica
from silo.state.requests import refused_running

REPLY_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class RobotProgram:
    """Asks the robot program, where it lives and may do it. What it does for them is raised where it refuses."""

    replica: Replica
    reach: Callable[[Request[Any], float], Reply]  # returns its answer within so many s, else `GoesOn`

    def ask(self, request: Request[Any], turn: Turn) -> Reply:
        """Return what it answers; while its client listens it is waited for.

        Raises RequestRefusedError where it refuses or has ended, GoesOnError where it takes longer.
        """
        self.must_live()
        request = msgspec.structs.replace(request, client=turn.by, number=turn.number)
        return raised(self.reach(request, turn.left_s(REPLY_TIMEOUT_S)))

    def reply(self, request: Request[ReplyT], turn: Turn) -> ReplyT:
        """Return what it answers, if that is the reply of the request. Raises as `ask` does."""
        return checked(request, self.ask(request, turn), "the robot process")

    def must_live(self) -> None:
        """Raise RequestRefusedError where it has ended."""
        if died := self.replica.now.died:
            raise RequestRefusedError(RefusedWhy.DEAD, f"{died}; start the robot program again")

    def must_stop(self) -> None:
        """Raise RequestRefusedError while its logger runs."""
        if self.replica.now.state is State.RUNNING:
            raise refused_running()
