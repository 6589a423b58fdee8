"""One-sample spikes at random places in 500 signals, judged and captured by a real helper process.

    python .bench/long/spikes.py [--spikes 10000] [--kills 0] [--signals 500] [--seed 1]

Rows are pushed as fast as the helper process judges them and writes captures, at nominal 1 kHz. Spikes that follow one
another within `post` are of one capture. Told are spikes that were missed, captures that are wrong by a tick or a
value, and fires where nothing was; with `--kills` the helper process is killed so many times at random places, and
nothing may fire twice either.
"""

import argparse
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from processes import wait_until, workplace

import silo
from silo.client.client import Client
from silo.files.event_log import read_events
from silo.rpc.published import EventKind

Ints = np.ndarray[tuple[int], np.dtype[np.int64]]

PRE, POST = 7, 40
MOST_TOGETHER = 50  # spikes of one capture
ROWS = 6000  # of each ring
AHEAD = 2000  # ticks that the robot may be ahead of what is judged and written
PATIENCE_S = 120.0


@dataclass
class Counts:
    """What came out."""

    missed: int = 0
    wrong: int = 0
    false: int = 0
    twice: int = 0

    @property
    def good(self) -> bool:
        """Whether nothing did."""
        return not (self.missed or self.wrong or self.false or self.twice)


def _groups(rng: np.random.Generator, spikes: int) -> dict[int, Ints]:
    """Ticks of spikes by the first of those that are of one capture."""
    found: dict[int, Ints] = {}
    tick, left = 100, spikes
    while left:
        size = min(left, int(rng.integers(1, MOST_TOGETHER + 1)))
        group = tick + np.cumsum(rng.integers(2, POST, size))
        found[int(group[0])] = group
        tick, left = int(group[-1]) + POST + PRE + int(rng.integers(2, 60)), left - size
    return found


class Scenario:
    """A logger with its helper process, and the spikes that it will have."""

    def __init__(self, folder: Path, spikes: int, signals: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.groups = _groups(self.rng, spikes)
        self.places = np.concatenate(list(self.groups.values()))
        self.signals = dict(zip(self.places.tolist(), self.rng.integers(0, signals, spikes).tolist(), strict=True))
        self.ends = np.array([group[-1] + POST for group in self.groups.values()])
        self.ticks = int(self.ends[-1]) + 100
        self.log = silo.Logger("spiked", frequency=1000, max_time=0, folder=folder, script=folder / "none.yaml")
        self.arrays = [self.log.array(f"s{at}", (), group="sig", buffer="looping", size=ROWS) for at in range(signals)]
        self.log.trigger("spike", "max(sig/*) > 50", pre=f"{PRE}ms", post=f"{POST}ms")
        self.folder = folder
        self.checked: dict[int, int] = {}  # captures by the tick of their first fire
        self.found: set[int] = set()  # spikes in them
        self.looked_at: set[Path] = set()
        self.counts = Counts()
        self.serving = self.log.serve()
        self.log.start()

    def push(self, count: int) -> None:
        """Run the loop."""
        for tick in range(self.log.ticks, self.log.ticks + count):
            at = self.signals.get(tick)
            if at is not None:
                self.arrays[at][...] = 100.0
            self.log.collect()
            if at is not None:
                self.arrays[at][...] = 0.0

    def caught_up(self, client: Client, tick: int) -> bool:
        """Whether all before a tick is judged, and captured in files that were looked at."""
        self.check_files()
        due = int(np.searchsorted(self.ends, tick))
        return len(self.checked) >= due and client.connected and _judged(client) >= tick

    def check_files(self) -> None:
        """Look at new captures, and empty them: 10,000 spikes would take 1 GB. Their names stay, for `--kills`."""
        for path in sorted(set(self.folder.glob("spiked_*_spike_*.silo")) - self.looked_at):
            self.looked_at.add(path)
            log = silo.open_log(path)
            facts = log.recording.conditions.capture
            assert facts is not None
            tick = facts.fires[0]
            self.checked[tick] = self.checked.get(tick, 0) + 1
            self.found |= set(facts.fires)
            self.counts.false += len(set(facts.fires) - set(self.signals))
            if tick in self.groups and not self._is_right(log, self.groups[tick], facts.fires):
                self.counts.wrong += 1
                print(f"wrong: {path.name}, {log.warnings}")
            os.truncate(path, 0)

    def _is_right(self, log: silo.Log, group: Ints, fires: tuple[int, ...]) -> bool:
        found = log.recording
        first = found.offset - len(found.time_ns)
        values = np.stack([element.entries[0].values for element in found.elements])
        wanted = np.zeros((len(self.arrays), PRE + int(group[-1] - group[0]) + 1 + POST))
        for tick in group.tolist():
            wanted[self.signals[tick], tick - group[0] + PRE] = 100.0
        exact = values.shape == wanted.shape and bool((values == wanted).all())
        return exact and first == group[0] - PRE and fires == tuple(group.tolist())

    def finish(self) -> None:
        """Hold what was told against what there was."""
        run = self.log._present.run
        assert run is not None
        events = read_events(self.folder, "spiked", run.id)
        fired = [event.tick for event in events if event.kind == EventKind.TRIGGERED.value]
        self.counts.missed = len(set(self.signals) - self.found)
        self.counts.twice = sum(count - 1 for count in self.checked.values()) + len(fired) - len(set(fired))
        self.counts.false += len(set(fired) - set(self.signals))
        blind = [event.text for event in events if event.kind == EventKind.BLIND.value]
        print(*blind[:5], sep="\n", end="\n" if blind else "")
        self.log.close()


def _judged(client: Client) -> int:
    try:
        return client.triggers().tick
    except silo.SiloError:
        return -1  # its helper process was killed just now


def spike(folder: Path, spikes: int, signals: int, kills: int, seed: int) -> Counts:
    """Run a scenario; returns what was not as it should be."""
    made = Scenario(folder, spikes, signals, seed)
    deaths = sorted(made.rng.integers(0, made.ticks, kills).tolist())
    with Client.connect("spiked") as client:
        while made.log.ticks < made.ticks:
            count = min(int(made.rng.integers(1, AHEAD // 2)), made.ticks - made.log.ticks)
            made.push(count)
            if deaths and made.log.ticks >= deaths[0]:
                deaths.pop(0)
                pid = made.serving.helper_pid
                os.kill(pid, signal.SIGKILL)
                wait_until(lambda pid=pid: made.serving.is_up and made.serving.helper_pid != pid, PATIENCE_S)
            behind = made.log.ticks - AHEAD
            if not wait_until(lambda behind=behind: made.caught_up(client, behind), PATIENCE_S, 0.02):
                print(f"the helper process is stuck before tick {behind}")
                break
        wait_until(lambda: made.caught_up(client, made.ticks), PATIENCE_S, 0.02)
    made.finish()
    return made.counts


def main() -> int:
    """Return 0 if nothing was missed, wrong, false or told twice."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for option, given in (("--spikes", 10_000), ("--kills", 0), ("--signals", 500), ("--seed", 1)):
        parser.add_argument(option, type=int, default=given)
    chosen = parser.parse_args()
    with workplace() as (folder, environment):
        os.environ.update(environment)
        begun_s = time.monotonic()
        found = spike(folder / "logs", chosen.spikes, chosen.signals, chosen.kills, chosen.seed)
        print(
            f"{chosen.spikes} spikes in {chosen.signals} signals, {chosen.kills} kills, "
            f"{time.monotonic() - begun_s:.0f} s: missed {found.missed}, wrong {found.wrong}, false {found.false}, "
            f"twice {found.twice}"
        )
    return 0 if found.good else 1


if __name__ == "__main__":
    sys.exit(main())
