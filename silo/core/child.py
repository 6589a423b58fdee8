"""A process of silo's own beside this one: how it is started, what of this one it gets, how it is ended.

It is a module of silo, found where this one was, whatever stands in the present folder. It is in a session of its own:
Ctrl-C in a terminal reaches this process alone, which ends its children in order.
"""

import contextlib
import ctypes
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

import msgspec

from silo.core.runtime import boot_id, closing_file, pid_namespace, process_facts, process_start
from silo.decoding import json_decoder

log = logging.getLogger("silo")

ENDING_S = 2.0  # how long one may take from closing its channel to its end
_PR_SET_PDEATHSIG = 1
NONE, PIPE = subprocess.DEVNULL, subprocess.PIPE

_HOME = str(Path(__file__).resolve().parents[2])  # where this silo is

# `-m` and `-c` put the present folder first: a `queue.py` of the robot's would be the program's, too
RUN = (
    f"import sys; sys.path[:] = [{_HOME!r}, *filter(None, sys.path)]; del sys.argv[0]; import runpy; "
    "runpy.run_module(sys.argv[0], run_name='__main__', alter_sys=True)"
)


def own_program(module: str) -> list[str]:
    """Return the words that run a module, or `__main__` of a package: of this silo, and none in the present folder."""
    return [sys.executable, "-c", RUN, module]


class ChildProcess:
    """A process that was started. Of those with pipes a `with` closes these, and waits for its end."""

    def __init__(
        self,
        module: str,
        arguments: Sequence[str | int],
        descriptors: Sequence[int] = (),
        *,
        environment: Mapping[str, str] | None = None,
        stdin: int = NONE,
        stdout: int | None = None,
    ) -> None:
        """Start `python -m module` with these arguments, these descriptors by their numbers, and this environment more.

        Raises OSError.
        """
        given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        own = {
            "PYTHONPATH": os.pathsep.join(dict.fromkeys([_HOME, *given])).strip(os.pathsep),  # first where this silo is
            "PYTHONSAFEPATH": "1",  # heeded from Python 3.11 on
            "PYTHONFAULTHANDLER": "1",  # one that dies of a fault in compiled code says where it stood
        }
        program = [sys.executable, "-m", module] if sys.version_info >= (3, 11) else own_program(module)
        self._process: subprocess.Popen[bytes] = subprocess.Popen(
            [*program, *map(str, arguments)],
            pass_fds=descriptors,
            env=dict(os.environ, **own, **(environment or {})),
            start_new_session=True,
            stdin=stdin,
            stdout=stdout,
        )

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def is_there(self) -> bool:
        """Whether it lives."""
        return self._process.poll() is None

    @property
    def stdin(self) -> IO[bytes]:
        """What it reads, where that is a pipe."""
        assert self._process.stdin is not None, "it was started without"
        return self._process.stdin

    @property
    def stdout(self) -> IO[bytes]:
        """What it says, where that is a pipe."""
        assert self._process.stdout is not None, "it was started without"
        return self._process.stdout

    def wait(self) -> int:
        """Wait for its end, which was asked for; return its exit code."""
        return self._process.wait()

    def wait_within(self, timeout_s: float = ENDING_S) -> int | None:
        """Return its exit code; None where it still lives after that time."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> int:
        """End it at once, if it hasn't; return its exit code."""
        self._process.kill()
        return self._process.wait()

    def end(self, timeout_s: float = ENDING_S) -> int:
        """Let one that is about to end do so; kill it if it doesn't. Return its exit code."""
        code = self.wait_within(timeout_s)
        return self.kill() if code is None else code

    def __enter__(self) -> "ChildProcess":
        return self

    def __exit__(self, *_: object) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()


def end_with_parent(number: int) -> None:
    """Have the kernel send this process a signal when the thread ends that started it; 0: none."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


# ------------------------------------------------------------------------------------------- of a parent that is gone


class Holder(msgspec.Struct, frozen=True):
    """The child process that holds a lock, as its file tells those who wait: its pid alone may be another's by now."""

    pid: int
    start: int
    parent: int
    boot_id: str
    pid_namespace: int


_decode_holder = json_decoder(Holder).decode


def note_holder(descriptor: int, parent: int) -> None:
    """Have a file that this process holds say so; `parent` started this process."""
    pid = os.getpid()
    one = Holder(pid, process_start(pid), parent, boot_id(), pid_namespace())
    with contextlib.suppress(OSError):  # a full disk: then nobody knows
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, msgspec.json.encode(one), 0)


def end_abandoned_holder(descriptor: int) -> bool:
    """Kill the process that holds a file if it was frozen (SIGSTOP) and its parent is gone: nobody has it go on.

    Any other stays: one that runs is about to end by itself, and what a living parent froze is its parent's.
    """
    with contextlib.suppress(OSError, msgspec.MsgspecError):  # one of an older silo doesn't say who it is
        status = os.fstat(descriptor)
        one = _decode_holder(os.pread(descriptor, status.st_size, 0))
        if status.st_uid == os.geteuid() and (one.boot_id, one.pid_namespace) == (boot_id(), pid_namespace()):
            return _end_abandoned(one)
    return False


def _end_abandoned(one: Holder) -> bool:
    with closing_file(os.pidfd_open(one.pid)) as descriptor:  # before it is looked at: what is killed is what was seen
        state, parent, start = process_facts(one.pid)
        if (state, start) != ("T", one.start) or parent == one.parent:
            return False
        signal.pidfd_send_signal(descriptor, signal.SIGKILL)
        log.warning("ended process %d: it was frozen, and the process that had started it is gone", one.pid)
        return True
