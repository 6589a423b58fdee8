"""`python -m silo.recorder FD PID`: a recorder, told by that process over that socket; `--close FOLDER`: its rests."""

import contextlib
import logging
import os
import signal
import socket
import sys
from pathlib import Path

from silo.core.child import end_with_parent
from silo.core.elements import RecorderState
from silo.polling import readable
from silo.printing import print_printable
from silo.recorder.orders import MAX_PACKET_BYTES, decode_order
from silo.recorder.recorder import Recorder
from silo.recovery.parts import close_parts

NICER = 5


def main() -> int:
    """Record, or close what recorders left in a folder."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print_printable()
    logging.basicConfig(format="silo recorder: %(message)s", level=logging.WARNING)
    if sys.argv[1] == "--close":
        os.nice(NICER)
        closed, problems = close_parts(Path(sys.argv[2]))
        for text in [*(part.text for part in closed), *problems]:
            print(text, flush=True)
        return 1 if problems else 0
    sock = socket.socket(fileno=int(sys.argv[1]))
    body = _order(sock)
    if not body:
        return 1
    order = decode_order(body)
    if not order.resume:
        _let_others_go_first()
    recorder = Recorder(order, sock, calm_down=_let_others_go_first, parent=int(sys.argv[2]))
    signal.signal(signal.SIGTERM, recorder.on_term)
    return 0 if recorder.run() is RecorderState.ENDED else 1


def _order(sock: socket.socket) -> bytes:
    """The first packet; what is kept for the case that a recorder is killed waits for it here, all imported.

    Should the helper process be killed meanwhile, the kernel ends it, also one that is frozen: nobody knows of it.
    """
    if readable(sock.fileno(), timeout_s=0):
        return sock.recv(MAX_PACKET_BYTES)
    end_with_parent(signal.SIGKILL)
    body = sock.recv(MAX_PACKET_BYTES)
    end_with_parent(0)
    return body


def _let_others_go_first() -> None:
    """All threads, which have priorities of their own, and those that they start.

    Not before one that was killed has caught up: on a computer with much to do that would take longer than the rings
    last.
    """
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, int(thread.name), NICER)


if __name__ == "__main__":
    sys.exit(main())
