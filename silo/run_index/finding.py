"""Which runs there are below a folder: names and sizes alone; of a save in several formats the best."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from silo.files.csv.metadata import SIDECAR
from silo.files.formats import FORMATS, LOG_ENDINGS

NAME = ".silo-runs.sqlite"  # of the index, in the folder of which it is
_READ = tuple(ending for one in FORMATS if one.for_logs or (one.mark and one.reader) for ending in one.endings)
_PREFERENCE = {ending: place for place, ending in enumerate([*LOG_ENDINGS, *_READ])}


_LAST_NS = 2**63 - 1  # of times of change, which a wrong clock may set to any year


class There(NamedTuple):
    """A log as it lies there: what changes when it is written anew; `others` are its other formats, by their paths."""

    size_bytes: int
    changed_ns: int
    others: tuple[tuple[str, int, int], ...] = ()


def logs_below(root: Path, unfit: list[str] | None = None) -> dict[str, There]:
    """Return the logs below a folder by their paths relative to it. Raises OSError where it can't be read.

    Names that can't be shown, or stored, go to `unfit`: they have control characters, or are no UTF-8.
    """
    found: dict[str, list[tuple[int, str, There]]] = {}
    for name, there in _below(root, "", _names(root), [] if unfit is None else unfit):
        stem, ending = _split(name)
        found.setdefault(stem, []).append((_PREFERENCE[ending], name, there))
    best: dict[str, There] = {}
    for formats in found.values():
        (_, name, there), *others = sorted(formats) if len(formats) > 1 else formats
        best[name] = There(*there[:2], tuple((other, *about[:2]) for _, other, about in others))
    return best


def _below(root: Path, folder: str, names: list[str], unfit: list[str]) -> Iterator[tuple[str, There]]:
    present = set(names)
    with os.scandir(root / folder) as entries:
        for entry in entries:
            name = entry.name
            if name.startswith("."):
                continue
            ending = _split(name)[1]
            if not name.isprintable():
                if ending in _PREFERENCE:
                    unfit.append(folder + name)
                continue
            try:
                if entry.is_dir():
                    inner = _names(entry.path)
                    if "metadata.yaml" in inner:
                        if ending in _PREFERENCE:
                            yield folder + name, _of_bag(Path(entry.path), inner)
                    elif not entry.is_symlink():  # which may lead in a circle
                        yield from _below(root, f"{folder}{name}/", inner, unfit)
                elif ending in _PREFERENCE and (ending != ".csv" or name + SIDECAR in present):
                    about = entry.stat()
                    yield folder + name, There(about.st_size, min(about.st_mtime_ns, _LAST_NS))
            except OSError:  # it vanished, or may not be read: the next look will see
                continue


def _of_bag(bag: Path, inner: list[str]) -> There:
    about = [(bag / name).stat() for name in inner]
    return There(sum(one.st_size for one in about), min(max(one.st_mtime_ns for one in about), _LAST_NS))


def _names(folder: str | Path) -> list[str]:
    return os.listdir(folder)  # noqa: PTH208  # of 10,000 logs no paths are made


def _split(name: str) -> tuple[str, str]:
    return os.path.splitext(name)  # noqa: PTH122  # likewise
