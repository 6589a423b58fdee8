"""A process that has loaded what a helper process loads, and forks one for each request: DESCRIPTOR of its socket.

It is started as a helper process is, so that its children have that environment; see `tests/warm.py`.
"""

import json
import os
import select
import socket
import sys


def main() -> int:
    control = socket.socket(fileno=int(sys.argv[1]))
    import silo.helper.__main__ as helper

    children: dict[int, tuple[int, int]] = {}  # by what tells of its end: its pid, and where its exit code is told
    while True:
        for ready in select.select([control, *children], [], [])[0]:
            if ready is not control:
                pid, told = children.pop(ready)
                code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                os.close(ready)
                os.write(told, str(code).encode())
                os.close(told)
                continue
            request, given, _, _ = socket.recv_fds(control, 2**18, 5)
            if not request:
                return 0
            pid = os.fork()
            if pid:
                children[os.pidfd_open(pid)] = (pid, given.pop())
                for each in given:
                    os.close(each)
                control.send(str(pid).encode())
                continue
            control.close()
            for pidfd, (_, told) in children.items():
                os.close(pidfd)
                os.close(told)
            return _be_helper(json.loads(request), given, helper)


def _be_helper(asked: dict, given: list[int], helper) -> int:
    """Do what `python -m silo.helper` does."""
    link, runs, out, err, told = given
    os.close(told)
    os.setsid()
    for number, descriptor in enumerate((os.open(os.devnull, os.O_RDONLY), out, err)):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(asked["environment"])
    os.chdir(asked["folder"])
    sys.argv = ["silo.helper", "--fd", str(link), "--runs-fd", str(runs), *asked["arguments"]]
    return helper.main()


if __name__ == "__main__":
    sys.exit(main())
