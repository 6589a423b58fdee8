"""Robots that exist only as sessions of one process: a token, answers, a summary each. To test and measure fleets.

`python tests/stand_ins/simulated_robots.py FILE COUNT [--host HOST]` has so many connect to a router, until its input
ends: each on a host of its own, or all on one.
"""

import argparse
import socket
import sys
import threading
import time
from typing import Any

import msgspec
import zenoh

from silo.core.elements import Present, State, Status
from silo.net.access.probing import reach
from silo.net.keys import Root
from silo.net.session import close, open_client
from silo.requests import GetStatus, Start, Stop, decode_ask, decode_do
from silo.rpc.declaring import Done
from silo.rpc.published import Summary
from silo.rpc.refusals import Refused, RefusedWhy, answered
from silo.rpc.versions import OLDEST, PROTOCOL
from silo.state.requests import GetSummary, Hello, HelloReply, StatusReply, SummaryReply
from silo.version import VERSION

POLL_S = 0.005
_encoder = msgspec.msgpack.Encoder()


class SimulatedRobot:
    """One robot. `mute`: it lives, and answers nothing that is asked. `refuses`: it does nothing, and says why."""

    def __init__(self, config: str, host: str, name: str = "anymal", drawn: str = "") -> None:
        self.root = Root(host, name, drawn or f"{abs(hash((host, name))) % 16**10:010x}")
        self.mute, self.refuses = False, ""
        self.started_ns = time.time_ns()
        self.state, self.lost = State.RUNNING, 0
        self.hz = 400.0
        self.session = open_client(None, config, reach(config))
        ring = zenoh.handlers.RingChannel
        self._queries = [self.session.declare_queryable(self.root.key(key), ring(64)) for key in ("ask", "do/*")]
        self._unanswered: list[zenoh.Query] = []
        self._publisher = self.session.declare_publisher(self.root.key("summary"))
        self._token = self.session.liveliness().declare_token(self.root.key("alive"))

    @property
    def status(self) -> Status:
        ticks = int(self.hz * (time.time_ns() - self.started_ns) / 1e9)
        return Status(
            logger=self.root.logger, host=self.root.host, user="lab", pid=4711, helper_pid=4712, state=self.state,
            revision=1, frequency_hz=400.0, measured_hz=self.hz if self.state is State.RUNNING else 0.0, ticks=ticks,
            started_ns=self.started_ns, last_tick_ns=0, lost=self.lost, elements=500, enabled=500, entries=500,
            max_time_s=0.0, prefix="/log", folder="/logs", script="robot.yaml", disk_free_bytes=40 * 10**9,
            disk_bytes=256 * 10**9, clients=[Present("ann@desk", 0)], saved=False,
        )  # fmt: skip

    def publish(self) -> None:
        self._publisher.put(_encoder.encode(Summary.of(self.status)))

    def serve(self) -> None:
        """Answer what has come."""
        for queryable, decode in zip(self._queries, (decode_ask, decode_do), strict=True):
            while (query := queryable.handler.try_recv()) is not None:
                if self.mute:
                    self._unanswered.append(query)  # one that is dropped ends at once
                    continue
                with query:
                    payload = query.payload.to_bytes() if query.payload is not None else b""
                    query.reply(
                        str(query.key_expr),
                        _encoder.encode(answered(lambda decode=decode, payload=payload: self._answer(decode(payload)))),
                    )

    def _answer(self, request: Any) -> Any:
        if isinstance(request, Hello):
            return HelloReply(PROTOCOL, VERSION, "lab", True, self.status, OLDEST)
        if isinstance(request, GetSummary):
            return SummaryReply(Summary.of(self.status))
        if isinstance(request, GetStatus):
            return StatusReply(self.status)
        if self.refuses:
            return Refused(RefusedWhy.FORBIDDEN, self.refuses)
        if isinstance(request, Stop | Start):
            self.state = State.STOPPED if isinstance(request, Stop) else State.RUNNING
            self.publish()
            return StatusReply(self.status)
        return Done()

    def close(self) -> None:
        self._unanswered.clear()
        close(self.session)


class SimulatedRobots:
    """Many of them, served by one thread; their rates differ a little each second. A context manager."""

    def __init__(self, config: str, hosts: list[str], names: list[str] | None = None) -> None:
        """One logger on each of the hosts, or all `names` on each."""
        self.robots = [SimulatedRobot(config, host, name) for host in hosts for name in names or ["anymal"]]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robots")
        self._thread.start()

    def _run(self) -> None:
        told_s, count = time.monotonic(), 0
        while not self._stop.wait(POLL_S):
            for robot in self.robots:
                robot.serve()
            if time.monotonic() - told_s >= 1.0:
                told_s, count = time.monotonic(), count + 1
                for place, robot in enumerate(self.robots):
                    robot.hz = 400.0 + (count + place) % 8
                    if (count + place) % 4 == 0:  # real ones tell what is new alone
                        robot.publish()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        for robot in self.robots:
            robot.close()

    def __enter__(self) -> "SimulatedRobots":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def main() -> None:
    """Run them until the input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config")
    parser.add_argument("count", type=int)
    parser.add_argument("--host", default="")
    arguments = parser.parse_args()
    many = range(arguments.count)
    hosts, names = [f"robot{place:03}" for place in many], None
    if arguments.host:
        hosts, names = [arguments.host], [f"leg{place:03}" for place in many]
    with SimulatedRobots(arguments.config, hosts, names):
        print(f"{arguments.count} robots on {socket.gethostname()}", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
