"""What the robot program pushes to its helper process: how its logger stands, and its runs.

Each run is handed over as an open file before its first tick.

A channel of its own beside the link, of whole packets, because descriptors can't travel among framed messages. The
kernel keeps a packet when the robot program dies right after it: the helper process takes in all of them before it does
anything else, and so knows every run that ever had a tick. The open file stays readable when its name is deleted.
"""

import mmap
import os
import socket

import msgspec

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import State, Table
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError, lacks_descriptors

MAX_OFFER_BYTES = 16_384
TAKEN_FILES = 8  # that who takes a run over has open of it, with those who read it


class RunOffer(msgspec.Struct, frozen=True):
    """A run that is about to begin, or, to a new helper process, that goes on: its id and its segment's path.

    `named` is False where that path was deleted under the running program, which the helper before this one has told.
    """

    run: str
    segment: str
    named: bool = True


class RobotState(msgspec.Struct, frozen=True, tag=True, rename={"conditions": "extras"}):
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
    conditions: Conditions = NO_CONDITIONS
    saved: str = ""  # where the run before this one was saved, if its start did that; fit to show
    cut_off: int = 0  # ticks of stretches before the present one that are in no file
    begun_ns: int = 0  # when the first of these began, and all their ticks; 0 without a cut
    before_ticks: int = 0
    changes: int = 0  # how many of `ChangeCount` it knows of
    done: dict[str, bytes] = {}  # to a new helper process: the last answers to numbered requests, by number


_NOTE_BYTES = 16  # where it begins: behind the number, and its length


class ChangeCount:
    """How many changes the robot program made to its logger: a number in memory that its helper process has, too.

    A change is counted when it is made, and told a moment later: whoever is asked in between can tell that it is to
    come. For one writer at a time. Behind it a helper process leaves a note to the one that follows it.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        """Share the memory of a descriptor that was handed over, which stays open; None for new memory."""
        self.descriptor = os.memfd_create("silo-changes") if descriptor is None else descriptor
        if descriptor is None:
            os.ftruncate(self.descriptor, mmap.PAGESIZE)
        self._bytes = memoryview(mmap.mmap(self.descriptor, mmap.PAGESIZE))
        self._number = self._bytes.cast("Q")

    @property
    def now(self) -> int:
        """Changes until now."""
        return self._number[0]

    def add(self) -> None:
        """Count one. Never waits."""
        self._number[0] += 1

    def leave(self, note: bytes) -> None:
        """Leave a note in place of the one before; what is killed amid that leaves none, as does one that is too long.

        For one thread at a time.
        """
        self._number[1] = 0
        if _NOTE_BYTES + len(note) <= len(self._bytes):
            self._bytes[_NOTE_BYTES : _NOTE_BYTES + len(note)] = note
            self._number[1] = len(note)

    def left(self) -> bytes:
        """Return the note that was left; empty for none."""
        return bytes(self._bytes[_NOTE_BYTES:][: self._number[1]])

    def close(self) -> None:
        """Close the descriptor."""
        os.close(self.descriptor)


_decoder = msgpack_decoder(RunOffer)


def handover_pair() -> tuple[socket.socket, socket.socket]:
    """The two ends: of the robot program, and of the helper process. Neither ever waits."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setblocking(False)  # Python passes no flags on with descriptors (3.10 to 3.13)
    return ends


def offer_run(sock: socket.socket, offer: RunOffer, descriptor: int) -> bool:
    """Hand over a run; False where the helper process is gone or takes nothing in. Never waits."""
    try:
        socket.send_fds(sock, [msgspec.msgpack.encode(offer)], [descriptor])
    except OSError:
        return False
    return True


def taken_runs(sock: socket.socket) -> list[tuple[RunOffer, int]]:
    """All runs that were handed over since the last call, oldest first, each with a descriptor to close.

    Never waits; nothing more comes when the robot program is gone. While no further file can be opened they stay where
    they are. Raises ConnectionLostError for bytes that are none.
    """
    taken: list[tuple[RunOffer, int]] = []
    while _has_room(sock):
        try:
            body, descriptors, flags, _ = socket.recv_fds(sock, MAX_OFFER_BYTES, 4)
        except (BlockingIOError, ConnectionResetError):
            return taken
        if not body:
            return taken
        if flags & socket.MSG_CTRUNC and not descriptors:
            continue  # another thread took the last one: the run is found by its name
        try:
            (descriptor,) = descriptors
            taken.append((_decoder.decode(body), descriptor))
        except (ValueError, msgspec.MsgspecError) as error:
            for each in descriptors:
                os.close(each)
            raise ConnectionLostError(f"a run can't be taken over: {error}") from error
    return taken


def _has_room(sock: socket.socket) -> bool:
    """Whether a run can be taken over now: of one that comes while no file can be opened the kernel drops the file."""
    copies: list[int] = []
    try:
        while len(copies) < TAKEN_FILES:
            copies.append(os.dup(sock.fileno()))
    except OSError as error:
        if not lacks_descriptors(error):
            raise
    finally:
        for copy in copies:
            os.close(copy)
    return len(copies) == TAKEN_FILES
