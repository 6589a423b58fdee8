"""Endless recordings."""

from typing import ClassVar

import msgspec

from silo.model import RecorderState
from silo.rpc.declaring import Ask, Do, Done, Lane, Reply


class RecorderInfo(msgspec.Struct, frozen=True):
    """An endless recording. `samples`, `lost` and `parts` count since it was started, `size_bytes` is on the disk now.

    `written_bytes` counts since it was started too, what was deleted since along with it.

    `split_bytes`, `split_s` and `keep_bytes` are 0 for no limit; `text` says how it ended, if it did.
    """

    name: str
    folder: str
    state: RecorderState
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0
    part: str = ""
    parts: int = 0
    size_bytes: int = 0
    samples: int = 0
    lost: int = 0
    since_ns: int = 0
    by: str = ""
    text: str = ""
    pid: int = 0
    written_bytes: int = 0


class RecorderStarted(Reply, frozen=True):
    """It records. `folder` is absolute, on the robot; `text` says what will not be recorded as one may think."""

    name: str
    folder: str
    text: str = ""


class Recorders(Reply, frozen=True):
    """All recorders of a logger; those that ended by themselves stay until they are stopped."""

    recorders: list[RecorderInfo]


class ListRecorders(Ask[Recorders], frozen=True):
    """Which endless recordings are there, and how far are they?"""


class StartRecorder(Do[RecorderStarted], frozen=True):
    """Record what these patterns mean (all without any) to MCAP files, from now on and across new starts.

    `folder` lies inside the logger's folder; only the robot program may name another. A part ends at `split_bytes` or
    after `split_s`; of all parts `keep_bytes` are kept, the oldest go. 0 is no limit. `name` is drawn if it is empty.
    """

    lane: ClassVar[Lane] = Lane.RECORDERS

    name: str = ""
    folder: str = ""
    patterns: list[str] = []
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0


class StopRecorder(Do[Done], frozen=True):
    """Finish the part and end; an empty name is the only one."""

    lane: ClassVar[Lane] = Lane.RECORDERS

    name: str = ""
