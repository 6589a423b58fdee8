"""The link between the robot process and its helper: framed messages on a socket pair, msgspec structs in msgpack."""

import contextlib
import socket
import struct
from collections.abc import Callable

import msgspec

from silo.core.elements import SavedFile
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError
from silo.polling import writable
from silo.requests import AnyDo, AnyReply
from silo.state.handover import RobotState

ASKED_EVERY_S = 1.0
MAX_BYTES = 256 * 2**20  # a table of a million elements; more is not a message of ours
_LENGTH = struct.Struct("<I")

READY = 0  # number of the LinkReply that says that clients can come, or why they can't
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

    The first `ticks` of the run of that id stand in files; after an error of some formats those of the others.
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

_decoder = msgpack_decoder(LinkMessage)


class LinkChannel:
    """Sends and receives whole messages: 4 bytes of length, then msgpack.

    `receive` reads exactly one message and nothing beyond it, so that `readable` of the socket stays right. Sending and
    receiving may be done by two threads; two senders need a lock of their own.
    """

    def __init__(self, sock: socket.socket) -> None:
        self.socket = sock

    def send(self, message: LinkMessage, give_up: Callable[[], bool] | None = None) -> None:
        """Send one message; waits while the other side's buffer is full. Raises OSError if it is gone.

        `give_up` is asked once a second of such waiting: if it says so, the link is ended and TimeoutError raised, as
        half a message can't be taken back.
        """
        body = msgspec.msgpack.encode(message)
        data = memoryview(_LENGTH.pack(len(body)) + body)
        if give_up is None:
            self.socket.sendall(data)
            return
        while data:
            if self.socket.fileno() < 0:
                raise BrokenPipeError("this end of the link is closed")  # poll tells it by a ValueError
            if writable(self.socket.fileno(), ASKED_EVERY_S):
                with contextlib.suppress(BlockingIOError):
                    data = data[self.socket.send(data, socket.MSG_DONTWAIT) :]
            elif give_up():
                with contextlib.suppress(OSError):
                    self.socket.shutdown(socket.SHUT_RDWR)
                raise TimeoutError("the other end of the link takes nothing in")

    def receive(self) -> LinkMessage | None:
        """Return the next message; None when the other side is gone, also in the middle of a message.

        Raises ConnectionLostError for bytes that are no message.
        """
        header = self._read(_LENGTH.size)
        if header is None:
            return None
        (size,) = _LENGTH.unpack(header)
        if size > MAX_BYTES:
            raise ConnectionLostError(f"a message of {size} bytes on the link to the helper process; limit {MAX_BYTES}")
        body = self._read(size)
        if body is None:
            return None
        try:
            message: LinkMessage = _decoder.decode(body)
        except msgspec.MsgspecError as error:
            raise ConnectionLostError(f"a message on the link can't be understood: {error}") from error
        return message

    def _read(self, size: int) -> bytearray | None:
        data = bytearray(size)
        view = memoryview(data)
        done = 0
        while done < size:
            try:
                count = self.socket.recv_into(view[done:])
            except ConnectionResetError:
                return None
            if count == 0:
                return None
            done += count
        return data
