"""What a judge knows, in a small file beside the segments: the helper process that replaces a killed one reads it.

One file per run, `<logger>.<run>.judge` in the runtime folder, replaced as a whole and checked when it is read. It is
written before anything is told: what was told is never told anew, and what was not is told by the successor.
"""

import contextlib
import threading
import zlib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from silo.conditions.limit_judge import LimitMemory
from silo.core.conditions import Conditions, TriggerOptions
from silo.core.elements import ElementInfo
from silo.core.runtime import JUDGE_SUFFIX, process_start, runtime_dir, write_private
from silo.decoding import msgpack_decoder
from silo.errors import SegmentError
from silo.expressions.evaluation import EvaluatorMemory
from silo.judging.triggers import Capture, Trigger
from silo.segment.held_runs import Program, is_live, judge_path, program_of
from silo.segment.layout import SegmentSchema

_MAGIC = b"silo judge 1\n"


class Untold(msgspec.Struct, frozen=True):
    """An event that clients and the log may not have got; `kind` is a word of EventKind, `tick` -1 for the newest.

    `about` is the trigger that it is of.
    """

    kind: str
    text: str
    tick: int = -1
    stamp_ns: int = 0
    times: int = 1
    about: str = ""


class KeptCapture(msgspec.Struct, frozen=True):
    """A capture that is under way, or waits to be written."""

    options: TriggerOptions
    capture: Capture
    ended: str = ""


class KeptTrigger(msgspec.Struct, frozen=True):
    """A trigger, and what its conditions remember."""

    options: TriggerOptions
    trigger: Trigger
    evaluator: EvaluatorMemory | None


class JudgeState(msgspec.Struct, frozen=True, rename={"conditions": "extras"}):
    """What is known of a run of a robot process: everything before tick `until` is judged.

    `cursors` are rows of rings, `numbers` the captures so far of each trigger's name. `closed`: the run has ended.
    `failed` tells why it is judged no more.
    """

    run: str
    pid: int
    pid_start: int
    until: int
    conditions: Conditions
    cursors: dict[int, int]
    triggers: list[KeptTrigger]
    limits: list[LimitMemory]
    numbers: dict[str, int]
    captures: list[KeptCapture] = []
    untold: list[Untold] = []
    closed: bool = False
    failed: str = ""
    off: list[ElementInfo] = []  # elements in conditions that are not logged
    program: Program = Program()  # whose run it is; of nobody in the files of an older silo
    folder: str = ""  # of its event log

    @property
    def is_begun_only(self) -> bool:
        """Whether nothing of the run was judged yet: it only says that it is to be."""
        return not (self.until or self.triggers or self.limits or self.captures or self.failed)

    @property
    def is_orphan(self) -> bool:
        """Whether the logger of the run is gone, be it with its process."""
        if self.program.logger_id:
            return not is_live(self.program)
        return process_start(self.pid) != self.pid_start


def array_parts(value: Any) -> Any:
    """Return an array as what MessagePack knows."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    raise NotImplementedError(f"{type(value).__name__} is not kept")


def array_of(kind: type, value: Any) -> Any:
    """Return the array that was written. Raises ValueError."""
    if kind is not np.ndarray:
        raise NotImplementedError(f"{kind.__name__} is not kept")
    dtype, shape, data = value
    return np.frombuffer(data, dtype).reshape(shape).copy()


# who takes a run over notes that it is begun, while its judge may store what it knows of it already
_storing = threading.RLock()
_encoder = msgspec.msgpack.Encoder(enc_hook=array_parts)
_decoder = msgpack_decoder(JudgeState, array_of)


def store_state(path: Path, state: JudgeState) -> None:
    """Replace the file as a whole. It needs to outlive a process, not the computer. Raises OSError."""
    body = _encoder.encode(state)
    with _storing:
        write_private(path, _MAGIC + zlib.crc32(body).to_bytes(4, "little") + body)


def begun_state(schema: SegmentSchema) -> JudgeState:
    """Return what is known of a run of which nothing is judged."""
    return JudgeState(
        schema.run, schema.pid, schema.pid_start, 0, schema.conditions, {}, [], [], {}, program=program_of(schema),
        folder=schema.folder,
    )  # fmt: skip


def note_begun(schema: SegmentSchema) -> None:
    """Store that a run is to be judged, before anybody is told of it: a successor of this process judges it, too.

    Nothing where something is stored, or nothing is to be judged, or nothing can be stored. In memory that is full an
    empty file says it, as it needs no room: the run is held by it, and judged from its begin.
    """
    if not schema.conditions.judged:
        return
    with _storing, contextlib.suppress(OSError, SegmentError):  # then a successor judges what it finds in the buffers
        path = judge_path(schema.logger, schema.run)
        if not path.exists():
            try:
                store_state(path, begun_state(schema))
            except OSError:
                path.touch(0o600)


def is_note(path: Path) -> bool:
    """Whether a file only says that its run is to be judged. Raises OSError where there is none."""
    return not path.stat().st_size


def read_state(path: Path) -> JudgeState:
    """Return what stands in a file. Raises SegmentError for a damaged one, OSError where there is none."""
    text = path.read_bytes()
    head = len(_MAGIC)
    body = text[head + 4 :]
    if text[:head] != _MAGIC or zlib.crc32(body).to_bytes(4, "little") != text[head : head + 4]:
        raise SegmentError(f"{path}: the state of the triggers is damaged, or of another silo")
    try:
        return _decoder.decode(body)
    except (msgspec.MsgspecError, ValueError, TypeError) as error:
        raise SegmentError(f"{path}: the state of the triggers is damaged ({error})") from error


def all_states(logger: str = "") -> list[Path]:
    """Return the files that judges left, of a logger or of all. Raises SegmentError without a runtime folder."""
    found = sorted(
        path for path in runtime_dir().iterdir() if path.suffix == JUDGE_SUFFIX and not path.name.startswith(".")
    )
    return [path for path in found if logger in ("", path.stem.rpartition(".")[0])]
