"""The original's CSV, which silo reads and doesn't write: a row per entry, with a cell per tick."""

from pathlib import Path

from silo.files.csv.metadata import pack, sidecar_of
from silo.files.csv.writer import _cells, _quoted, _spread, _texts

SECOND = 1_000_000_000


def write_rows(recording, path):
    """Write a recording with one row per entry, and its facts beside it."""
    elements = [element for element in recording.elements if element.count]
    times = (recording.time_ns // SECOND, recording.time_ns % SECOND)
    rows = [
        (f"{recording.prefix}/{name}", _texts(each)) for name, each in zip(("time_s", "time_ns"), times, strict=True)
    ]
    for element in elements:
        for entry in element.entries:
            cells = _cells(element, entry.values, 0, len(recording.time_ns))
            rows.append((entry.name, _spread(_texts(cells.values), cells, "")))
    lines = [",".join([_quoted(name) if set(name) & set(',"\r\n') else name, *texts, "\n"]) for name, texts in rows]
    Path(path).write_bytes("".join(lines).encode("utf-8", "backslashreplace"))
    sidecar_of(path).write_bytes(pack(recording, elements))
