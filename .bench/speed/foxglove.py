"""What Foxglove viewers cost a robot: `python .bench/speed/foxglove.py`.

A 1 kHz loop collects 100 float64 and serves them by `serve(foxglove=...)`. First the CPU time of the bridge's process
with 0, 1 and 5 viewers of five topics each, all viewers in one other process. Then the lateness of the loop's ticks
beside a viewer that subscribed to all topics and reads nothing, in turns with a control: no bridge, but a process that
burns as much CPU in as many bursts a second.

Turns share the machine's moods, so that the comparison holds where the figures don't.
"""

import argparse
import contextlib
import json
import os
import selectors
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

import numpy as np
import psutil

import silo
from silo.bridges.feed import PERIOD_S
from silo.bridges.foxglove.protocol import MESSAGE_DATA
from silo.core.runtime import shared_memory_root

FREQUENCY = 1000
ELEMENTS = 100
TOPICS = 5


@contextlib.contextmanager
def robot(*, bridge: bool) -> Iterator[tuple[silo.Logger, int, int]]:
    """A logger that runs; its bridge's port and process id, 0 for none."""
    with tempfile.TemporaryDirectory(dir=shared_memory_root()) as folder:
        log = silo.Logger("foxglove", frequency=FREQUENCY, max_time=30, folder=folder, script=f"{folder}/none.yaml")
        for place in range(ELEMENTS):
            log.array(f"x{place}", 1)
        with log.serve(foxglove=0 if bridge else None) as serving:
            log.start()
            bridges = [one.pid for one in psutil.Process().children() if "silo.bridges.foxglove" in one.cmdline()]
            yield log, serving.foxglove_port or 0, sum(bridges)
            log.stop()
        log.close(discard=True)


def lateness_us(log: silo.Logger, seconds: float) -> np.ndarray:
    """Collect for a while; how late each tick of the paced loop began."""
    ticks, period = int(seconds * FREQUENCY), 1_000_000_000 // FREQUENCY
    found = np.zeros(ticks)
    deadline = time.monotonic_ns() + period
    for place in range(ticks):
        while (left := deadline - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        found[place] = -left * 1e-3
        log.collect()
        # a loop that is late goes on at the next deadline that is still to come
        deadline += period * max(1, -(-(time.monotonic_ns() - deadline) // period))
    return found


def cpu_s(pid: int) -> float:
    """The CPU time that a process has used."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


# ------------------------------------------------------------------------------------------------- the other processes


class Viewer:
    """Subscribes and counts messages; bare sockets, so that it costs little itself."""

    def __init__(self, port: int, topics: int) -> None:
        self.messages = 0
        self.socket = socket.create_connection(("localhost", port))
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: c2lsb3NpbG9zaWxvc2lsbw==\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        said = b""
        while f"/log/x{ELEMENTS - 1}".encode() not in said:
            said += self.socket.recv(1 << 16)
        pairs = [{"id": number, "channelId": number} for number in range(1, topics + 1)]
        request = json.dumps({"op": "subscribe", "subscriptions": pairs}).encode()
        self.socket.sendall(struct.pack(">BBH4x", 0x81, 0x80 | 126, len(request)) + request)  # a mask of zeros
        self._rest = said[said.rindex(b"}") + 1 :]

    def read(self) -> None:
        """Count the data frames of what has come."""
        data, at = self._rest + self.socket.recv(1 << 18), 0
        while at + 2 <= len(data):
            size, start = data[at + 1], at + 2
            if size == 126:
                size, start = int.from_bytes(data[start : start + 2], "big"), start + 2
            if start + size > len(data):
                break
            self.messages += data[at] == 0x82 and data[start] == MESSAGE_DATA
            at = start + size
        self._rest = data[at:]


def watch(port: int, count: int) -> None:
    """Viewers of the first topics; says that they look, and at the end of its input how many messages came."""
    viewers = [Viewer(port, TOPICS) for _ in range(count)]
    print("looking", flush=True)
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin, selectors.EVENT_READ)
        for one in viewers:
            selector.register(one.socket, selectors.EVENT_READ, one)
        while True:
            for key, _ in selector.select():
                if key.data is None:
                    print(sum(one.messages for one in viewers))
                    return
                key.data.read()


def freeze(port: int) -> None:
    """A viewer of all topics that reads nothing, until the end of input."""
    one = Viewer(port, ELEMENTS)
    print("looking", flush=True)
    sys.stdin.read()
    one.socket.close()


def burn(share: float) -> None:
    """Use a share of a processor in bursts, as often as the bridge reads, until it is killed."""
    print("looking", flush=True)
    while True:
        end = time.process_time() + share * PERIOD_S
        while time.process_time() < end:
            pass
        time.sleep(PERIOD_S * (1 - share))


def beside(*arguments: object) -> "subprocess.Popen[str]":
    """Start this program in another role; returns when it looks."""
    command = [sys.executable, __file__, *map(str, arguments)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "looking\n"
    return process


# --------------------------------------------------------------------------------------------------------- the figures


def cost(viewers: int, seconds: float) -> tuple[float, int]:
    """CPU seconds of the bridge, and how many messages came to all viewers."""
    with robot(bridge=True) as (log, port, pid):
        lateness_us(log, 1)  # the bridge has begun
        before = cpu_s(pid)
        looking = beside("--watch", viewers, "--port", port) if viewers else None
        lateness_us(log, seconds)
        got = int(looking.communicate()[0]) if looking else 0
        return cpu_s(pid) - before, got


def beside_frozen(seconds: float) -> tuple[np.ndarray, float]:
    """Lateness beside a frozen viewer, and the share of a processor that the bridge used."""
    with robot(bridge=True) as (log, port, pid):
        lateness_us(log, 1)
        frozen = beside("--freeze", "--port", port)
        before, begin = cpu_s(pid), time.monotonic()
        found = lateness_us(log, seconds)
        share = (cpu_s(pid) - before) / (time.monotonic() - begin)
        frozen.kill()
        frozen.communicate()
    return found, share


def beside_control(seconds: float, share: float) -> np.ndarray:
    """Lateness beside a process that burns this share of a processor."""
    with robot(bridge=False) as (log, _, _):
        lateness_us(log, 1)
        burning = beside("--burn", share)
        found = lateness_us(log, seconds)
        burning.kill()
        burning.communicate()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=4, help="turns of each kind")
    parser.add_argument("--seconds", type=float, default=5, help="length of a turn")
    for role, kind in (("port", int), ("watch", int), ("burn", float)):
        parser.add_argument(f"--{role}", type=kind, help=argparse.SUPPRESS)
    parser.add_argument("--freeze", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.watch:
        return watch(options.port, options.watch)
    if options.freeze:
        return freeze(options.port)
    if options.burn is not None:
        return burn(options.burn)

    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors; {FREQUENCY} Hz, {TOPICS} topics a viewer\n")
    print("viewers   bridge, % of a core   messages/s   CPU ms per 1,000 messages")
    for viewers in (0, 1, 5):
        used, got = cost(viewers, options.seconds)
        each = f"{used / got * 1e6:.2f}" if got else "-"
        print(f"{viewers:7} {used / options.seconds * 100:20.1f} {got / options.seconds:12.0f} {each:>27}", flush=True)

    frozen, control, shares = [], [], []
    for _ in range(options.rounds):
        late, share = beside_frozen(options.seconds)
        frozen.append(late)
        shares.append(share)
        control.append(beside_control(options.seconds, share))
    print(
        f"\nlateness of the loop in us        p50      p99      max   (bridge {np.mean(shares) * 100:.1f} % of a core)"
    )
    for name, rounds in (("beside a frozen viewer", frozen), ("beside equal CPU load", control)):
        late = np.concatenate(rounds)
        print(f"{name:<26} {np.percentile(late, 50):10.0f} {np.percentile(late, 99):8.0f} {late.max():8.0f}")
    print(f"load at the end {os.getloadavg()[0]:.1f}")
    return None


if __name__ == "__main__":
    main()
