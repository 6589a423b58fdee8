"""What travels between a recorder and the process that started it: msgspec structs in JSON, a packet each."""

import os
from functools import partial

import msgspec

from silo.core.conditions import Conditions
from silo.core.elements import RecorderState
from silo.decoding import json_decoder

MAX_PACKET_BYTES = 180_000  # within the send buffer of a socket as Linux has it by default
TEXT_BYTES = 2_000
CLOSED = "the logger was closed, or its program ended"  # why a recorder ends that was to record all of the last run


class RecordOrder(msgspec.Struct, frozen=True):
    """The first packet: who records what to where. `folder` is absolute; 0 is no limit.

    `resume`: go on where this recorder was, as its ledger and its parts tell; of the run in which the order was given,
    where these tell nothing, from `tick` on. Otherwise what is logged from now on is recorded. `order` tells this order
    from others of that name. `runs` are the ids of those that are to come at once, None where that isn't said.
    """

    name: str
    folder: str
    patterns: tuple[str, ...] = ()
    split_bytes: int = 0
    split_s: float = 0.0
    keep_bytes: int = 0
    resume: bool = False
    order: str = ""
    run: str = ""
    tick: int = 0
    runs: tuple[str, ...] | None = None


class Follow(msgspec.Struct, frozen=True, tag=True):
    """A run to be recorded; its segment comes along as a descriptor. What is still to come of the last one is taken.

    A second descriptor is a file with its `Conditions`, which may be larger than a packet: derived signals, limits and
    triggers as they are when it is handed over; without it, as a recorder before this one knew them last, or as they
    were when the run began.
    """

    segment: str


class NewConditions(msgspec.Struct, frozen=True, tag="Conditions"):
    """Limits, triggers or what is derived are others from a tick on; the descriptor is a file with the `Conditions`."""

    tick: int = 0


class Finish(msgspec.Struct, frozen=True, tag=True):
    """Record what is there, finish the part, and end. `why` goes into the last report.

    `events` is the number of the newest event that the event log has, or will have in a moment. `died`: the program
    ended without a word, whatever the kernel says of its process yet.
    """

    why: str
    events: int = 0
    died: bool = False


class Progress(msgspec.Struct):
    """How far a recorder is. Counts are of all its parts since the order; `size_bytes` is what stands on the disk."""

    state: RecorderState
    text: str = ""
    part: str = ""
    parts: int = 0
    size_bytes: int = 0
    written_bytes: int = 0
    samples: int = 0
    lost: int = 0


class Report(Progress):
    """With it, what is told once.

    `finished` is a part that was just finished, with why where the next one goes on; `told` what clients are to hear:
    losses, parts that were closed. `told_run` and `told_tick` say where a loss begins, or a part ends, or a recorder,
    of a run that may be over. `done` is a run that stands in parts from end to end.
    """

    finished: str = ""
    told: str = ""
    done: str = ""
    told_run: str = ""
    told_tick: int = -1


News = partial[Report]  # what is told, to be sent with how far the recorder is by then


Command = Follow | NewConditions | Finish

encode = msgspec.json.Encoder().encode
decode_order = json_decoder(RecordOrder).decode
decode_command = json_decoder(Command).decode
decode_report = json_decoder(Report).decode
_decode_conditions = json_decoder(Conditions).decode


def conditions_file(conditions: Conditions) -> int:
    """Return a file in memory with conditions, to be handed over and closed. Raises OSError."""
    descriptor = os.memfd_create("silo-conditions", os.MFD_CLOEXEC)
    try:
        with os.fdopen(os.dup(descriptor), "wb") as file:
            file.write(encode(conditions))
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def conditions_of(descriptor: int) -> Conditions:
    """Return the conditions that a file has which was handed over. Raises OSError, MsgspecError."""
    return _decode_conditions(os.pread(descriptor, os.fstat(descriptor).st_size, 0))


def recorded_of(conditions: Conditions) -> tuple[object, ...]:
    """What of limits and triggers stands in parts; to arm a trigger makes no new one."""
    return conditions.limits, tuple(msgspec.structs.replace(one, armed=True) for one in conditions.triggers)
