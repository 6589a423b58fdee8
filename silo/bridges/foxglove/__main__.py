"""`python -m silo.bridges.foxglove`: started by `Logger.serve(foxglove=...)`, not by people."""

import argparse
import logging
import os
import socket
import sys

from silo.bridges.foxglove.server import Terms, run
from silo.client.client import Client
from silo.printing import print_printable


def main() -> None:
    """Serve a logger on a socket that was handed over, until standard input ends: with the robot program."""
    parser = argparse.ArgumentParser(prog="python -m silo.bridges.foxglove", description=__doc__)
    parser.add_argument("--fd", type=int, required=True, help="a socket that is bound")
    parser.add_argument("--logger", required=True, help="its name and process id")
    arguments = parser.parse_args()
    print_printable()
    logging.basicConfig(level=logging.WARNING, format="silo: %(message)s", stream=sys.stderr)
    log = logging.getLogger("silo.foxglove")
    terms = Terms(arguments.logger.rpartition(".")[0])
    listening = socket.socket(fileno=arguments.fd)
    if os.read(sys.stdin.fileno(), 1):  # the logger can be reached now; empty where it never came so far
        run(
            terms,
            lambda: Client.connect(arguments.logger, read_only=True),
            listening,
            log.warning,
            ends_with=sys.stdin.fileno(),
        )


if __name__ == "__main__":
    main()
