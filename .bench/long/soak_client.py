"""The clients of `soak.py`: `python soak_client.py KIND SECONDS`. It prints `uncounted N`: gaps not told.

watch: all values and eight plots at 5 Hz, with histories, as silo-tui asks. follow: every sample of twenty topics.
save: one save after the other, in all formats. flood: as many requests as eight threads can make. visit: connects, asks
and leaves again.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable

import numpy as np

import silo
from silo.client.client import Client
from silo.core.elements import FileType

NAME = "soaked"
FLOODING = 8


def watch(client: Client, seconds: float) -> int:
    """A view like that of a terminal."""
    elements = client.table().elements
    plots = [info.name for info in elements if info.options.action.publishes][:8]
    end = time.monotonic() + seconds
    with client.view([info.name for info in elements], plots, rate_hz=5) as view:
        while time.monotonic() < end:
            frame = view.frame()
            if frame is not None and frame.time_ns and not frame.tick % 5:
                client.history(plots, frame.time_ns - 4_000_000_000, frame.time_ns, 10_000_000)
            time.sleep(0.2)
    return 0


def follow(client: Client, seconds: float) -> int:
    """Topics; `tick` must go on by one, but for what is told to be missed and where a new run began."""
    names = [info.name for info in client.table().elements if info.options.action.publishes]
    topics = [client.topic(name) for name in names[1:20]]
    ticks = client.topic(names[0])
    end = time.monotonic() + seconds
    newest, number, uncounted = 0, 0, 0
    while time.monotonic() < end:
        for topic in topics:
            topic.read()
        for batch in ticks.read():
            if newest and batch.first >= number:
                told = batch.first - number
                uncounted += abs(int(batch.values[0]) - newest - 1 - told)
            uncounted += int(np.count_nonzero(np.diff(batch.values) != 1))
            newest, number = int(batch.values[-1]), batch.first + len(batch.values)
        time.sleep(0.05)
    return uncounted


def save(client: Client, seconds: float) -> int:
    """Saves, one at a time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for file_type in FileType:
            client.wait_saved(client.save([file_type]))
            time.sleep(1.0)
    return 0


def flood(client: Client, seconds: float) -> int:
    """Requests without a pause; refusals and silence are what a flood may get."""
    end = time.monotonic() + seconds
    names = [info.name for info in client.table().elements][:64]

    def ask() -> None:
        calls: list[Callable[[], object]] = [
            client.table,
            client.status,
            client._hello,
            lambda: client.history(names, 1_700_000_000_000_000_000, 1_700_000_004_000_000_000, 1_000_000),
        ]
        while time.monotonic() < end:
            for call in calls:
                with contextlib.suppress(silo.SiloError):
                    call()

    threads = [threading.Thread(target=ask) for _ in range(FLOODING)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return 0


def visit(client: Client, seconds: float) -> int:
    """Connections that come and go."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        client.status()
        with Client.connect(NAME) as another:
            another.table()
    return 0


KINDS = {"watch": watch, "follow": follow, "save": save, "flood": flood, "visit": visit}


def main() -> None:
    """One client; it may be killed at any time."""
    kind, seconds = sys.argv[1], float(sys.argv[2])
    with Client.connect(NAME, timeout_s=10.0) as client:
        try:
            print(f"uncounted {KINDS[kind](client, seconds)}", flush=True)
        except silo.SiloError as error:
            print(f"refused {kind}: {error}", flush=True)


if __name__ == "__main__":
    main()
