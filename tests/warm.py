"""Processes that start warm: forked off one that has loaded silo, numpy and Zenoh already.

A start of Python with all that takes 0.3 s of processor time, and the tests start some 1,500 of these. What is tested
is the same but for the very start and end, which those that are about it have as users have it (`cold`). What a warm
process starts is warm, too. Its parent is the nursery, and its command line that one's.
"""

import atexit
import contextlib
import ctypes
import faulthandler
import fcntl
import functools
import gc
import importlib.util
import inspect
import io
import json
import logging
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from silo.core.child import RUN
from silo.logger.serving.process import HELPER_ENVIRONMENT
from tests.thin_net import WITHIN

ADDRESS, COLD = "SILO_TEST_NURSERY", "SILO_TEST_COLD"
HEAD = "SILO_TEST_HEAD"  # the process of pytest whose tests these are, with which a nursery ends
ALLOCATOR = "PYTHONMALLOC"  # as helper processes have one of their own, a nursery has it from its start
MODULES = {"silo.cli", "silo.helper", "silo.recorder", "silo.recordings.writing", "silo.run_index.keeping"}
EXECUTABLE = sys.executable  # some tests say that it is another
_libc = ctypes.CDLL(None, use_errno=True)
_Popen = subprocess.Popen  # what stands for it while tests run is the one below
HOME = str(Path(__file__).parents[1])
_GIVEN = list(inspect.signature(subprocess.Popen._execute_child).parameters)[3:]  # type: ignore[attr-defined]
_MANY = 1000  # no descriptor that is asked for has so high a number


def _address(environment: dict[str, str]) -> str:
    """Where the nursery listens that has the allocator of this environment; abstract, so that nothing is left."""
    return f"\0{environment[ADDRESS]}-{environment.get(ALLOCATOR, '')}"


class WarmPopen(subprocess.Popen):
    """`subprocess.Popen`, warm where what is started is Python: a module of silo, a script or a text."""

    nursery: "Nursery | None" = None  # of this process, where it is its own

    def _execute_child(self, args: Any, executable: Any, *more: Any) -> None:
        given = dict(zip(_GIVEN, more, strict=True))
        environment = dict(os.environ if given["env"] is None else given["env"])
        words = [] if isinstance(args, str | bytes) else [os.fsdecode(word) for word in args]
        within, known = 0, environment
        if words[: len(WITHIN)] == WITHIN:  # its user knows of no nursery, whose address is none there
            within, words = int(words[len(WITHIN)]), words[len(WITHIN) + 2 :]
            known = {key: os.environ[key] for key in (ADDRESS, COLD) if key in os.environ} | environment
        if words[1:3] == ["-c", RUN]:
            words[1:3] = ["-m"]
        self._end: socket.socket | None = None
        if given["shell"] or given["preexec_fn"] is not None or not _is_warm(words, known):
            super()._execute_child(args, executable, *more)  # type: ignore[misc]
            return
        streams = {0: given["p2cread"], 1: given["c2pwrite"], 2: given["errwrite"]}
        taken = {number: number if one == -1 else one for number, one in streams.items()}
        taken |= {number: number for number in given["pass_fds"]}
        asked = {
            "words": words[1:], "environment": environment, "numbers": list(taken),
            "folder": os.fsdecode(given["cwd"] or Path.cwd()), "session": given["start_new_session"],
            "within": within,
        }  # fmt: skip
        if self.nursery is not None:
            self.nursery.begin()
        self._end = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._end.connect(_address(known))
        socket.send_fds(self._end, [json.dumps(asked).encode()], list(taken.values()))
        self.pid = int(self._end.recv(32))
        self._child_created = True
        self._close_pipe_fds(*(given[name] for name in _GIVEN[_GIVEN.index("p2cread") :][:6]))  # type: ignore[attr-defined]

    def _internal_poll(self, *more: Any, **named: Any) -> int | None:
        if self._end is None:
            return super()._internal_poll(*more, **named)  # type: ignore[misc]
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self._wait(0)
        return None

    def _wait(self, timeout: float | None) -> int:
        if self._end is None:
            return super()._wait(timeout)  # type: ignore[misc]
        if self.returncode is None and self._end.fileno() < 0:
            self.returncode = -signal.SIGKILL  # nobody held it any more, and its end of the line went with it
        if self.returncode is None:
            if not select.select([self._end], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            with self._waitpid_lock:  # type: ignore[attr-defined]
                if self.returncode is None:
                    told = self._end.recv(32)
                    self.returncode = int(told) if told else -signal.SIGKILL
                    self._end.close()
        return self.returncode


def _is_warm(words: list[str], environment: dict[str, str]) -> bool:
    if ADDRESS not in environment or len(words) < 2 or words[0] != EXECUTABLE:
        return False
    if not {*filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))} <= {HOME}:
        return False  # it may find another silo, or what changes its start
    what = words[2] if words[1] == "-m" and len(words) > 2 else words[1]
    if any(cold in ("all", what) for cold in environment.get(COLD, "").split()):
        return False
    return what in MODULES or what == "-c" or what.endswith(".py")


class Nursery:
    """The processes that fork, one for each allocator: begun by the first worker that needs them, for all of them."""

    def __init__(self, room: Path) -> None:
        self.name = f"silo-test-nursery-{room.name}"
        self._begun = room / "nursery"
        self._started: list[subprocess.Popen[bytes]] = []
        self._is_there = False
        self._beginning = threading.Lock()

    def begin(self) -> None:
        """Start them where they aren't there, and wait until they listen."""
        with self._beginning:
            if self._is_there:
                return
            with self._begun.open("a") as begun:
                fcntl.flock(begun, fcntl.LOCK_EX)
                if not os.fstat(begun.fileno()).st_size:
                    self._start()
                    begun.write("begun")
            self._is_there = True

    def _start(self) -> None:
        command = [EXECUTABLE, "-c", "from tests.warm import fork_for_all; fork_for_all()()", "silo.helper"]
        for more in ({}, HELPER_ENVIRONMENT):
            environment = dict(os.environ, PYTHONPATH=HOME, **{ADDRESS: self.name}, **more)
            self._started.append(_Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, env=environment))
        for one in self._started:
            one.stdout.readline()


# ------------------------------------------------------------------------------------------------ in the nursery


def fork_for_all() -> Callable[[], None]:
    """Fork a process for each that asks; return in the processes that were forked, with what they are to do."""
    atexit.register(_end)  # before all that is loaded: so it is called last
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(_address(dict(os.environ)))
    listener.listen(128)
    head = os.pidfd_open(int(os.environ[HEAD]))
    import numpy.char  # NumPy loads it with the first text of an array
    import numpy.ma  # noqa: F401 - and this with the first `unique`

    import silo.cli.bulk
    import silo.cli.edits
    import silo.cli.group
    import silo.client.client
    import silo.conditions.captures.files
    import silo.conditions.memory
    import silo.conditions.segment_judge
    import silo.files.csv.writer
    import silo.files.silo.writer
    import silo.helper.__main__
    import silo.logger.logger
    import silo.logger.serving.serving
    import silo.recorder.__main__
    import silo.recordings.writing
    import silo.settings.conditions_diff
    import silo.settings.script  # noqa: F401

    gc.freeze()  # a process that was forked looks through nothing of it, nor copies it by that
    print("ready", flush=True)
    children: dict[int, tuple[int, socket.socket]] = {}  # by what tells of its end: its pid, and who is told
    askers: set[socket.socket] = set()  # who has not said yet for what: one that is frozen then holds up no other
    while True:
        for ready in select.select([head, listener, *askers, *children], [], [])[0]:
            if ready == head:
                os._exit(0)
            if ready is listener:
                askers.add(listener.accept()[0])
                continue
            if ready not in askers:
                pid, asker = children.pop(ready)
                code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                os.close(ready)
                with contextlib.suppress(OSError), asker:
                    asker.send(str(code).encode())
                continue
            asker = ready
            askers.remove(asker)
            request, given, _, _ = socket.recv_fds(asker, 2**18, 32)
            if not request:
                asker.close()
                continue
            pid = os.fork()
            if not pid:
                for one in (listener, asker, *askers, *(each for _, each in children.values())):
                    one.detach()  # their numbers are others' from now on
                return _start(json.loads(request), given)
            for each in given:
                os.close(each)
            children[os.pidfd_open(pid)] = (pid, asker)
            with contextlib.suppress(OSError):
                asker.send(str(pid).encode())


def _enter(pid: int) -> None:
    """Go to the network and the host name of a process."""
    for kind in ("net", "uts"):
        with Path(f"/proc/{pid}/ns/{kind}").open() as namespace:
            if _libc.setns(namespace.fileno(), 0):
                raise OSError(ctypes.get_errno(), f"can't enter the namespace {kind} of {pid}")


def _start(asked: dict[str, Any], given: list[int]) -> Callable[[], None]:
    """Take descriptors, environment and folder that were asked for; return what is to be done."""
    high = [fcntl.fcntl(one, fcntl.F_DUPFD, _MANY) for one in given]
    os.closerange(0, _MANY)
    for number, one in zip(asked["numbers"], high, strict=True):
        os.dup2(one, number)
        os.close(one)
    if asked["session"]:
        os.setsid()
    if asked["within"]:
        _enter(asked["within"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    os.chdir(asked["folder"])
    unbuffered = bool(os.environ.get("PYTHONUNBUFFERED"))
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        file = open(number, f"{mode}b", -1 if mode == "r" or not unbuffered else 0, closefd=False)  # noqa: SIM115
        words = "backslashreplace" if name == "stderr" else None
        lines = name == "stderr" or (mode == "w" and file.isatty())
        stream = io.TextIOWrapper(file, "utf-8", words, line_buffering=lines, write_through=unbuffered)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    if os.environ.get("PYTHONFAULTHANDLER"):
        faulthandler.enable()
    if "numpy.random" in sys.modules:  # else who needs it loads it, and it has a seed of its own
        sys.modules["numpy.random"].seed()
    subprocess.Popen = WarmPopen  # type: ignore[misc]
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:] = [*filter(None, paths), *(one for one in sys.path[1:] if one != HOME)]
    what, *sys.argv = asked["words"]
    main = sys.modules["__main__"] = types.ModuleType("__main__")
    first = ""
    if what == "-c":
        code = compile(sys.argv[0], "<string>", "exec")
        sys.argv[0] = what
    elif what == "-m":
        spec = importlib.util.find_spec(sys.argv[0])
        if spec.submodule_search_locations is not None:
            spec = importlib.util.find_spec(f"{sys.argv[0]}.__main__")
        code = spec.loader.get_code(spec.name)
        main.__spec__, main.__package__, main.__file__ = spec, spec.parent, spec.origin
    else:
        sys.argv.insert(0, what)
        code, first, main.__file__ = compile(Path(what).read_text(), what, "exec"), str(Path(what).parent), what
    if "PYTHONSAFEPATH" not in os.environ:
        sys.path.insert(0, first)
    return functools.partial(_run, code, main.__dict__)


def _run(code: types.CodeType, names: dict[str, Any]) -> None:
    """Run a program, and note with what it ends, where that is no error."""
    try:
        exec(code, names)
        _ended_with.append(0)
    except SystemExit as end:
        if isinstance(end.code, int | None):
            _ended_with.append(end.code or 0)
        raise


_ended_with: list[int] = []


def _end() -> None:
    """End after all that a program asked for: Python takes apart what was loaded, all of which is copied by that.

    That would be two thirds of the time of a short program.
    """
    try:
        logging.shutdown()  # as one that is called at the end it would follow this
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not stream.closed:
                stream.flush()
    except OSError:
        return  # Python says it
    if _ended_with:
        os._exit(_ended_with[0])
