"""A format of your own: silo opens, plots, compares and converts it as its own ones.

Run: python .docs/recipes/added_format.py FOLDER

A package offers a reader, a writer, or both by one line of its pyproject.toml; nothing of silo is changed:

    [project.entry-points."silo.formats"]
    steps = "added_format:FORMAT"

They are loaded by `silo.open_log`, `log.save` and the shell's commands on saved files, when silo can't read or write an
ending itself; never in a robot program or in its helper process. The format here: `# NAME UNIT` lines, then one line
per tick: nanoseconds and values.
"""

import sys
from pathlib import Path

import numpy as np

import silo
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry
from silo.files.formats import Format

FORMAT = Format(
    name="steps",
    endings=(".steps",),
    about="lines of numbers",
    reader="added_format:read",
    writer="added_format:write",
)


def read(path: Path) -> silo.Recording:
    """Return what the file holds; an error of any kind is told with the name of the file."""
    lines = path.read_text().splitlines()
    heads = [line[2:].split(" ") for line in lines if line.startswith("# ")]
    rows = np.array([line.split(" ") for line in lines[len(heads) :]], dtype=float).reshape(-1, 1 + len(heads))
    elements = [
        RecordedElement(
            name, unit, "scalar", (), 1, BufferType.GROWING, 0,
            (RecordedEntry(name, Entry("", "<f8"), np.ascontiguousarray(rows[:, 1 + place])),),
        )
        for place, (name, unit) in enumerate(heads)
    ]  # fmt: skip
    return silo.Recording(path.stem, rows[:, 0].astype(np.int64), len(rows), elements)


def write(recording: silo.Recording, path: Path, progress: object = None) -> None:
    """Write the scalars of a recording at all of its ticks; where it fails, no file is left."""
    signals = [one for one in silo.Log(recording).values() if one.values.ndim == 1]
    ticks = silo.Signal("ticks", recording.time_ns, recording.time_ns, start_ns=int(recording.time_ns[0]))
    columns = [one.resample(ticks).values for one in signals]
    heads = "".join(f"# {one.name} {one.unit}\n" for one in signals)
    rows = zip(recording.time_ns.tolist(), *columns, strict=True)
    path.write_text(heads + "".join(f"{' '.join(map(str, row))}\n" for row in rows))


def installed(folder: Path) -> None:
    """Do what `pip install` of a package with that line does."""
    about = folder / "silo_steps-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: silo-steps\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[silo.formats]\nsteps = added_format:FORMAT\n")
    sys.path[:0] = [str(folder), str(Path(__file__).parent)]


def main() -> None:
    """Log, save, write in the new format, and read that."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    installed(folder / "packages")
    logger = silo.Logger("walk", frequency=100, folder=folder)
    height = logger.array("height", unit="m")
    logger.start()
    for tick in range(10):
        height[...] = 0.5 + tick / 100
        logger.collect()
    (saved,) = logger.save()
    logger.close()
    silo.open_log(saved.path).save(folder / "walk.steps")
    log = silo.open_log(folder / "walk.steps")
    print(f"{len(log['height'])} samples of height, at most {log['height'].max():.2f} {log['height'].unit}")


if __name__ == "__main__":
    main()
