"""What travels between a recorder and the process that started it: msgspec structs in JSON, a packet each."""

import msgspec

from silo.model import Derived, RecorderState

MAX_PACKET_BYTES = 180_000  # within the send buffer of a socket as Linux has it by default
TEXT_BYTES = 2_000


class RecordOrder(msgspec.Struct, frozen=True):
    """The first packet: who records what to where. `folder` is absolute; 0 is no limit.

    `resume`: go on where the newest part of this recorder ended, if it is of the run that comes first; otherwise what
    is logged from now on is recorded.
    """

    name: str
    folder: str
    patterns: tuple[str, ...] = ()
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0
    resume: bool = False


class Follow(msgspec.Struct, frozen=True, tag=True):
    """A run to be recorded; its segment comes along as a descriptor. What is still to come of the last one is taken.

    `derived` are signals that are computed of it, as they are when it is handed over.
    """

    segment: str
    derived: tuple[Derived, ...] = ()


class Finish(msgspec.Struct, frozen=True, tag=True):
    """Record what is there, finish the part, and end. `why` goes into the last report."""

    why: str


class Report(msgspec.Struct, frozen=True):
    """How far a recorder is. Counts are of all its parts since the order; `size_bytes` is what stands on the disk.

    `finished` is a part that was just finished, `told` what clients are to hear: losses, parts that were closed.
    """

    state: RecorderState
    text: str = ""
    part: str = ""
    parts: int = 0
    size_bytes: int = 0
    written_bytes: int = 0
    samples: int = 0
    lost: int = 0
    finished: str = ""
    told: str = ""


Command = Follow | Finish

encode = msgspec.json.Encoder().encode
decode_order = msgspec.json.Decoder(RecordOrder).decode
decode_command = msgspec.json.Decoder(Command).decode
decode_report = msgspec.json.Decoder(Report).decode
