"""The link between the robot process and its helper: framed messages on a socket pair, the same class at both ends."""

import contextlib
import select
import socket
import struct
from collections.abc import Callable

import msgspec

from silo.errors import ConnectionLostError
from silo.link.messages import LinkMessage

ASKED_EVERY_S = 1.0
MAX_BYTES = 256 * 2**20  # a table of a million elements; more is not a message of ours
_LENGTH = struct.Struct("<I")
_decoder = msgspec.msgpack.Decoder(LinkMessage)


class LinkChannel:
    """Sends and receives whole messages: 4 bytes of length, then msgpack.

    `receive` reads exactly one message and nothing beyond it, so that `select` on the socket stays right. Sending and
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
                raise BrokenPipeError("this end of the link is closed")  # select tells it by a ValueError
            if select.select([], [self.socket], [], ASKED_EVERY_S)[1]:
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
