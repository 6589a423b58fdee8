"""Computers of their own, as far as the kernel's network and host names go, joined by a link that may be slow.

Each is a network namespace with one address, in which commands run; packets go from one to another through this
process, which delays them (the kernels of many machines have no netem). Nothing leaves this machine. Needs root,
`/dev/net/tun`, `ip`, `unshare` and `nsenter`; `missing()` says what isn't there.
"""

import fcntl
import heapq
import itertools
import os
import select
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType

NETWORK = "10.98.0"
WITHIN = ["nsenter", "--net", "--uts", "--target"]  # what runs a command in the namespace of a process: its pid, `--`
MTU = 1400
_TUNSETIFF, _TUN_NO_HEADER = 0x400454CA, 0x0001 | 0x1000
_STOP = 0.05


def free_port() -> int:
    """Return a port of this computer that nobody has."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def missing() -> str:
    """Return why no such computers can be made here; empty where they can."""
    for tool in ("ip", "unshare", "nsenter"):
        if shutil.which(tool) is None:
            return f"needs the command {tool}"
    if not os.access("/dev/net/tun", os.W_OK):
        return "needs /dev/net/tun"
    tried = subprocess.run(["unshare", "--net", "--uts", "true"], capture_output=True, text=True, check=False)
    return f"can't make namespaces: {tried.stderr.strip()}" if tried.returncode else ""


class Computer:
    """One namespace; `address` is its own, `place` a folder of its own for what its user has."""

    def __init__(self, number: int, host: str, place: Path) -> None:
        self.address, self.host, self.place = f"{NETWORK}.{number}", host, place
        (place / "run").mkdir(mode=0o700, parents=True, exist_ok=True)
        mine, theirs = socket.socketpair()
        command = ["unshare", "--net", "--uts", sys.executable, __file__, str(theirs.fileno()), self.address, host]
        self._holder = subprocess.Popen(command, pass_fds=[theirs.fileno()], stdin=subprocess.PIPE)
        theirs.close()
        with mine:
            _, (self.tun,), _, _ = socket.recv_fds(mine, 1, 1)

    def command(self, *words: str) -> list[str]:
        """Return a command as it runs there."""
        return [*WITHIN, str(self._holder.pid), "--", *words]

    def environment(self, **more: str) -> dict[str, str]:
        """Return the variables of a user of that computer: nothing of ours but where programs are."""
        own = {"HOME": str(self.place), "XDG_CONFIG_HOME": str(self.place / "config")}
        own |= {"XDG_STATE_HOME": str(self.place / "state"), "SILO_RUNTIME_DIR": str(self.place / "run")}
        return {key: os.environ[key] for key in ("PATH", "PYTHONPATH", "LANG") if key in os.environ} | own | more

    def close(self) -> None:
        """End the namespace; what runs in it is ended by who started it."""
        assert self._holder.stdin is not None
        self._holder.stdin.close()
        self._holder.wait()
        os.close(self.tun)


class ThinNet:
    """Computers that reach each other, every packet `delay_s` late. A context manager."""

    def __init__(self, place: Path, hosts: list[str], delay_s: float = 0.0) -> None:
        self.delay_s = delay_s
        self._cut: set[bytes] = set()
        self.computers = [Computer(number, host, place / str(number)) for number, host in enumerate(hosts, 1)]
        self._tuns = {socket.inet_aton(one.address): one.tun for one in self.computers}
        self._ending = False
        self._thread = threading.Thread(target=self._relay, name="thin-net", daemon=True)
        self._thread.start()

    def _relay(self) -> None:
        flight: list[tuple[float, int, int, bytes]] = []  # when it arrives, its number, to whom, the packet
        numbers = itertools.count()
        while not self._ending:
            now_s = time.monotonic()
            while flight and flight[0][0] <= now_s:
                _, _, tun, packet = heapq.heappop(flight)
                try:
                    os.write(tun, packet)
                except OSError:
                    continue  # its queue is full: a real link drops it too
            wait_s = min(_STOP, max(0.0, flight[0][0] - now_s)) if flight else _STOP
            cut = self._cut
            for tun in select.select(list(self._tuns.values()), [], [], wait_s)[0]:
                packet = os.read(tun, 65536)
                target = self._tuns.get(packet[16:20]) if packet[0] >> 4 == 4 else None
                if target is not None and not cut & {packet[12:16], packet[16:20]}:
                    heapq.heappush(flight, (time.monotonic() + self.delay_s, next(numbers), target, packet))

    def cut(self, *computers: Computer) -> None:
        """Swallow all packets from and to these computers, and of no others any more."""
        self._cut = {socket.inet_aton(one.address) for one in computers}

    def __enter__(self) -> "ThinNet":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending = True
        self._thread.join()
        for one in self.computers:
            one.close()


def hold(channel: int, address: str, host: str) -> None:
    """Make the device and the name of the namespace that this process is in, hand the device over, and wait."""
    socket.sethostname(host)
    device = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(device, _TUNSETIFF, struct.pack("16sH22x", b"thin0", _TUN_NO_HEADER))
    for words in (
        ["link", "set", "lo", "up"],
        ["addr", "add", f"{address}/24", "dev", "thin0"],
        ["link", "set", "thin0", "up", "mtu", str(MTU)],
    ):
        subprocess.run(["ip", *words], check=True)
    with socket.socket(fileno=channel) as ours:
        socket.send_fds(ours, [b"x"], [device])
    os.close(device)
    sys.stdin.read()


if __name__ == "__main__":
    hold(int(sys.argv[1]), sys.argv[2], sys.argv[3])
