"""`python -m silo.helper`: started by `Logger.serve()`, not by people."""

import argparse
import contextlib
import logging
import os
import sys
import threading

from silo.core.elements import GroupRole
from silo.helper.helper import Helper, ServingOptions, open_link
from silo.net.knocking import raise_descriptors
from silo.printing import print_printable
from silo.recordings.heap import limit_heap


def main() -> int:
    """Run the helper process until its robot process is gone."""
    parser = argparse.ArgumentParser(prog="python -m silo.helper", description=__doc__)
    parser.add_argument("--fd", type=int, required=True, help="socket to the robot process")
    parser.add_argument("--runs-fd", type=int, required=True, help="socket on which the robot process hands over runs")
    # a program that was started before silo was upgraded gives none
    parser.add_argument("--changes-fd", type=int, help="memory with the number of the logger's changes")
    parser.add_argument("--name", required=True, help="name of the logger")
    parser.add_argument("--id", default="", help="what the logger drew to tell it from others of its name")
    parser.add_argument("--died", default="", help="how, and when (UNIX time in ns), the one before this one died")
    parser.add_argument("--group", help="system group whose members may connect")
    parser.add_argument("--config", help="Zenoh configuration with remote access")
    parser.add_argument("--group-role", type=GroupRole, default=GroupRole.OPERATOR, help="what its members may do")
    parser.add_argument("--control", default="any", help="one: changes need control")
    arguments = parser.parse_args()
    print_printable()
    logging.basicConfig(level=logging.WARNING, format="silo: %(message)s", stream=sys.stderr)
    threading.excepthook = end_at_panic
    limit_heap()
    raise_descriptors()
    robot = open_link(arguments.fd, arguments.runs_fd, arguments.changes_fd)
    serving = ServingOptions(arguments.group, arguments.config, arguments.group_role, arguments.control)
    return Helper(robot, arguments.name, serving, arguments.id, arguments.died).run()


def end_at_panic(args: threading.ExceptHookArgs) -> None:
    """Tell what ended a thread, and end the process where that was a panic of Zenoh, which is no `Exception`.

    It leaves locks behind that nobody gets any more; the robot program starts another helper process.
    """
    threading.__excepthook__(args)
    if not issubclass(args.exc_type, Exception | SystemExit):
        os._exit(1)


def _end(code: int) -> None:
    """End without taking Python apart, which takes 0.3 s more, and `Logger.close()` waits for that."""
    try:
        for thread in threading.enumerate():
            if not thread.daemon and thread is not threading.main_thread():
                thread.join()
        if sys.stdout is not None:  # as it is where the program was started without
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.flush()
    finally:
        os._exit(code)


if __name__ == "__main__":
    _end(main())
