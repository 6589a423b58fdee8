"""What the robot program pushes to its helper process: how its logger stands."""

import msgspec

from silo.core.elements import NO_EXTRAS, Conditions, State, Table


class RobotState(msgspec.Struct, frozen=True, tag=True):
    """Robot to helper: pushed at connection and after every change. `table` only when its revision changed."""

    logger: str
    pid: int
    state: State
    revision: int
    options_json: bytes  # LoggerOptions
    folder: str  # absolute
    script: str  # absolute
    segment: str  # path of the current or last segment, empty before the first start
    reason: str
    by: str
    table: Table | None = None
    extras: Conditions = NO_EXTRAS
    saved: str = ""  # where the run before this one was saved, if its start did that; fit to show
