"""`python -m silo.recorder FD`: a recorder, whose order and runs come over that socket; `--close FOLDER`: its rests."""

import logging
import os
import signal
import socket
import sys
from pathlib import Path

from silo.model import RecorderState
from silo.recorder.closing import close_parts
from silo.recorder.orders import MAX_PACKET_BYTES, decode_order
from silo.recorder.recorder import Recorder

NICER = 5


def main() -> int:
    """Record, or close what recorders left in a folder."""
    os.nice(NICER)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.basicConfig(format="silo recorder: %(message)s", level=logging.WARNING)
    if sys.argv[1] == "--close":
        closed, problems = close_parts(Path(sys.argv[2]))
        for text in [*(part.text for part in closed), *problems]:
            print(text, flush=True)
        return 1 if problems else 0
    sock = socket.socket(fileno=int(sys.argv[1]))
    body = sock.recv(MAX_PACKET_BYTES)
    if not body:
        return 1
    recorder = Recorder(decode_order(body), sock)
    signal.signal(signal.SIGTERM, recorder.on_term)
    return 0 if recorder.run() is RecorderState.ENDED else 1


if __name__ == "__main__":
    sys.exit(main())
