"""The program of `silo host`: reads the probes in turn, collects at 20 Hz."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from silo.core.elements import Action
from silo.logger.logger import Logger
from silo.programs.host.probes import PROBES
from silo.programs.host.reading import Reader, reader
from silo.programs.rate import Rate
from silo.programs.running import ProgramOptions, opened, read_own_script, run

FREQUENCY_HZ = 20.0


@dataclass(frozen=True, kw_only=True)
class HostOptions(ProgramOptions):
    """What `silo host` can be told; see its help."""

    name: str = "host"
    frequency_hz: float = FREQUENCY_HZ


class Monitor:
    """All sources that this computer has. `read()` once per tick reads those that are due.

    Slow sources with the same divider are read in different ticks, so that no tick carries all of them.
    """

    def __init__(self, log: Logger) -> None:
        self._due: list[tuple[Reader, int, int]] = []
        self._ticks = 0
        for place, probe in enumerate(PROBES):
            read = reader(probe, log)
            if read is not None:
                read()
                self._due.append((read, probe.divider, place % probe.divider))

    def read(self) -> None:
        """New values of the sources that are due in this tick."""
        for read, divider, phase in self._due:
            if self._ticks % divider == phase:
                read()
        self._ticks += 1


def run_host(options: HostOptions, say: Callable[[str], None] = print) -> None:
    """Log this computer until Ctrl-C, SIGTERM or the time limit. Raises SiloError when it can't log."""
    log = opened(options)
    lateness_ms = log.array(
        "lateness",
        group="loop",
        unit="ms",
        action=Action.SAVE_AND_PUBLISH,
        description="how late a tick came: the jitter, or delay, of the loop",
    )
    reading_ms = log.array("reading_time", group="loop", unit="ms", action=Action.SAVE_AND_PUBLISH)
    monitor = Monitor(log)
    read_own_script(log, options)

    def tick(rate: Rate) -> None:
        began_s = time.perf_counter()
        monitor.read()
        reading_ms[...] = (time.perf_counter() - began_s) * 1e3
        log.collect()
        lateness_ms[...] = rate.wait() / 1e6

    run(log, options, tick, say, ())
