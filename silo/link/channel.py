"""The link between the robot process and its helper: framed messages on a socket pair, the same class at both ends."""

import socket
import struct

import msgspec

from silo.errors import ConnectionLostError
from silo.link.messages import LinkMessage

MAX_BYTES = 256 * 2**20  # a table of a million elements; more is not a message of ours
_LENGTH = struct.Struct("<I")
_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(LinkMessage)


class LinkChannel:
    """Sends and receives whole messages: 4 bytes of length, then msgpack.

    `receive` reads exactly one message and nothing beyond it, so that `select` on the socket stays right. Sending and
    receiving may be done by two threads; two senders need a lock of their own.
    """

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock

    def send(self, message: LinkMessage) -> None:
        """Send one message; waits while the other side's buffer is full. Raises OSError if it is gone."""
        body = _encoder.encode(message)
        self._socket.sendall(_LENGTH.pack(len(body)) + body)

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
                count = self._socket.recv_into(view[done:])
            except ConnectionResetError:
                return None
            if count == 0:
                return None
            done += count
        return data
