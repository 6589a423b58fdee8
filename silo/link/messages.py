"""What travels on the link between a helper process and its robot process: msgspec structs in msgpack."""

import msgspec

from silo.core.elements import SavedFile
from silo.requests import AnyDo, AnyReply
from silo.state.robot_state import RobotState

FILES_DELETED = 75  # exit code of a helper process that ends so that its successor makes its socket anew


class LinkRequest(msgspec.Struct, frozen=True, tag=True):
    """Either way: a request with a number. Helper to robot: those handed on (`RobotRequest`); robot to helper: Save."""

    number: int
    request: AnyDo


class LinkReply(msgspec.Struct, frozen=True, tag=True):
    """The answer to the request of that number. The robot answers only after it has pushed its new `RobotState`."""

    number: int
    reply: AnyReply
    late: bool = False  # it came when nobody waited any more (`until_s`), and nothing was done


class LinkSaved(msgspec.Struct, frozen=True, tag=True):
    """Helper to robot: a save of any client came to its end; `error` is empty when it worked.

    Then the first `ticks` of the run of that id stand in files.
    """

    job: int
    files: list[SavedFile]
    error: str
    run: str = ""
    ticks: int = 0


class LetGo(msgspec.Struct, frozen=True, tag=True):
    """Robot to helper: let go of the present run's memory, and of those before it, it is needed for the next.

    `held_alone`: of those before it only.
    """

    held_alone: bool = False


class Beat(msgspec.Struct, frozen=True, tag=True):
    """Either way: a sign of life. The helper answers each with one; the program asks while somebody there waits."""


class Goodbye(msgspec.Struct, frozen=True, tag=True):
    """Robot to helper: closed on purpose; end without saving. End of file without it means that the robot died."""


LinkMessage = RobotState | LinkRequest | LinkReply | LinkSaved | LetGo | Beat | Goodbye
