"""A robot program as a service of systemd: tells that it is ready and alive, ends in order at `systemctl stop`.

`silo-robot.service` beside this file is its unit. Without systemd it runs just so: SIGTERM or the time limit ends it.

    python .docs/recipes/service.py FOLDER [SECONDS]
"""

import os
import signal
import socket
import sys
import threading
import time

import silo

RATE_HZ = 100


def tell_systemd(words: str) -> None:
    """Send `READY=1` and the like to who started this; nobody is told where that isn't systemd."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if address:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
            out.sendto(words.encode(), address.replace("@", "\0", 1))


def main(folder: str, seconds: float) -> None:
    """Log until SIGTERM, then save."""
    ending = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ending.set())
    with silo.Logger("service", frequency=RATE_HZ, max_time=0, folder=folder, storage="disk") as log:
        ticks = log.array("ticks", dtype="i8", action="both", buffer="looping", size="60s")
        with log.serve():
            log.start()
            tell_systemd("READY=1")
            end_s = time.monotonic() + seconds
            while not ending.wait(1 / RATE_HZ) and time.monotonic() < end_s:
                ticks += 1
                log.collect()
                if log.ticks % RATE_HZ == 0:
                    tell_systemd(f"WATCHDOG=1\nSTATUS={log.ticks} ticks")
            tell_systemd("STOPPING=1")
            log.stop()
            saved = log.save("silo")
    print(f"ended in order, {len(silo.open_log(saved[0].path)['ticks'])} samples saved")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".", float(sys.argv[2]) if len(sys.argv) > 2 else float("inf"))
