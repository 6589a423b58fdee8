"""What a recorder wrote, as its ledger has it: parts, and of each run what was to be recorded, and what was.

All numbers of a recording are computed of this, never told by a process: one may be new, or dead. Needs no MCAP.
"""

from pathlib import Path

import msgspec

from silo.model import Extras

MOST_RUNS = 100  # that are told one by one; of those before them the sums are kept
WRITTEN_ENDING = ".recorder.json"


class PartEntry(msgspec.Struct):
    """A part: its name when it is finished, its inode; size 0 while it is written. `run` is empty in older lists."""

    name: str
    inode: int
    size_bytes: int = 0
    run: str = ""


class RunEntry(msgspec.Struct):
    """A run: by ring, rows from `begin` to `end` were to be recorded as far as it was read, and `rows` of them were.

    `channels` are samples in a row. `done`: nothing more comes of it; `gone` says why not all that there was did.
    `extras` are what it was recorded with last, while it is not done.
    """

    run: str
    number: int = 0
    begin: dict[int, int] = {}
    end: dict[int, int] = {}
    rows: dict[int, int] = {}
    channels: dict[int, int] = {}
    parts: int = 0
    samples: int = 0
    size_bytes: int = 0
    done: bool = False
    gone: str = ""
    extras: Extras | None = None

    def lost(self, more: dict[int, int] | None = None, end: dict[int, int] | None = None) -> int:
        """Return how many samples are in no file; `more` are rows in parts that are open, with which it is at `end`."""
        more, end = more or {}, end or self.end
        return sum(
            many * max(0, end.get(ring, begin) - begin - self.rows.get(ring, 0) - more.get(ring, 0))
            for ring, many in self.channels.items()
            for begin in [self.begin.get(ring, 0)]
        )


class Sums(msgspec.Struct):
    """What became of an order: finished parts and their bytes, samples in them, samples that are in none.

    `gone` are runs of which an end is missing that nobody could count.
    """

    parts: int = 0
    samples: int = 0
    lost: int = 0
    size_bytes: int = 0
    gone: int = 0

    def add(self, run: RunEntry) -> None:
        """Take in a run."""
        self.parts += run.parts
        self.samples += run.samples
        self.lost += run.lost()
        self.size_bytes += run.size_bytes
        self.gone += bool(run.gone)

    @property
    def text(self) -> str:
        """All of it, fit to show."""
        more = f", and the end of {self.gone} runs" if self.gone > 1 else ", and the end of a run" if self.gone else ""
        return f"{self.parts} files, {self.samples} samples, {self.lost} lost{more}"


class Written(msgspec.Struct):
    """What the file holds: parts oldest first, with which rows of which run to go on, and the runs of an order."""

    recorder: str
    run: str = ""
    next_rows: dict[int, int] = {}
    parts: list[PartEntry] = []
    order: str = ""
    runs: list[RunEntry] = []
    before: Sums = msgspec.field(default_factory=Sums)  # of the runs before these

    def entry(self, run: str) -> RunEntry | None:
        """Return what there is of a run."""
        return next((one for one in self.runs if one.run == run), None)

    def sums(self) -> Sums:
        """Return what became of the order."""
        sums = msgspec.structs.replace(self.before)
        for run in self.runs:
            sums.add(run)
        return sums

    def fold(self) -> None:
        """Keep of the oldest runs no more than their sums."""
        while len(self.runs) > MOST_RUNS and self.runs[0].done:
            self.before.add(self.runs.pop(0))


def written_path(folder: Path, name: str) -> Path:
    """Return where a recorder of that name keeps its ledger."""
    return folder / f".{name}{WRITTEN_ENDING}"


decode_written = msgspec.json.Decoder(Written).decode


def read_written(folder: Path, name: str) -> Written | None:
    """Return the ledger of a recorder; None where there is none, or it is damaged."""
    try:
        return decode_written(written_path(folder, name).read_bytes())
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None
