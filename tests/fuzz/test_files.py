"""Damaged log files: whatever stands in them, nothing but silo's own errors comes out, and no memory is claimed.

2,000 damaged files of each format; `SILO_FUZZ_INPUTS=100000` takes so many. The number of a failure makes it again.
"""

import functools
import json
import os
import random
import re
import resource
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from silo.analysis.opening import open_log
from silo.errors import SiloError
from silo.files.formats import FORMATS, writer_for
from silo.kinds import struct_text
from silo.model import BufferType, Entry
from silo.recording import RecordedElement, RecordedEntry, Recording

COUNT = int(os.environ.get("SILO_FUZZ_INPUTS", "2000"))
ROOM_BYTES = 1 << 30
NUMBERS = [
    b"-1",
    b"0",
    b"1",
    b"999999999999",
    b"1000000000000000000",
    b"99999999999999999999999",
    b"1e400",
    b"nan",
    b"3.5",
]
WORDS = [
    b"",
    b"#",
    b"\x00",
    b"\xff\xfe",
    b'"',
    b",",
    b"\n",
    b" ",
    b"unknown",
    b"string",
    b"double",
    b"|V8",
    b"<M8[D]",
    b"O",
]
TARGETS = ["silo", "csv", "mcap", "sidecar", "rows", "checked", "bag"]
ENDINGS = {"sidecar": "csv", "rows": "csv", "checked": "silo"}
WAYS = 10  # in which a log is damaged before the next one is written, which takes longer than to read it


def a_recording(rng: random.Random) -> Recording:
    ticks = rng.randint(1, 12)
    fields = np.dtype([("a", "<f8"), ("b", "<i4", (2,))])
    plans = [
        ("x", "<f8", "scalar", (), [""], ""),
        ("v", "<f4", "vector", (3,), ["_x", "_y", "_z"], ""),
        ("mode", "|i1", "scalar", (), [""], ""),
        ("name", "|S5", "scalar", (), [""], ""),
        ("when", "<M8[ns]", "scalar", (), [""], ""),
        ("half", "<f2", "scalar", (1,), [""], ""),
        ("long", "<f16", "scalar", (), [""], ""),
        ("s", "<i4", "struct", (), ["_a", "_b_0", "_b_1"], struct_text(fields)),
    ]
    elements = []
    for name, dtype, kind, shape, suffixes, text in rng.sample(plans, rng.randint(1, 5)):
        divider = rng.randint(1, 3)
        count = len(range(0, ticks, divider))
        labels = {0: "stand"} if name == "mode" else None
        entries = tuple(
            RecordedEntry(f"/log/{name}{suffix}", Entry(suffix, dtype, labels), np.arange(count).astype(dtype))
            for suffix in suffixes
        )
        kept = rng.choice(list(BufferType))
        elements.append(RecordedElement(f"/log/{name}", "m", kind, shape, divider, kept, 0, entries, "", 0, text))
    times = 1_700_000_000_000_000_000 + np.arange(ticks) * 2_500_000
    return Recording("robot", times, ticks, elements, frequency_hz=400.0)


def damaged(data: bytes, rng: random.Random) -> bytes:
    """The bytes with one to four things wrong."""
    for _ in range(rng.randint(1, 4)):
        if not data:
            return data
        place = rng.randrange(len(data))
        how = rng.randrange(8)
        if how == 0:
            data = data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :]
        elif how == 1:
            data = data[:place]
        elif how == 2:
            other = rng.randrange(len(data))
            data = data[:place] + data[other : other + rng.randint(1, 64)] + data[place:]
        elif how == 3:
            data = data[:place] + data[place + rng.randint(1, 64) :]
        elif how == 4:
            numbers = list(re.finditer(rb"\d+(\.\d+)?", data))
            found = rng.choice(numbers) if numbers else None
            data = data[: found.start()] + rng.choice(NUMBERS) + data[found.end() :] if found else data
        elif how == 5:
            lines = data.split(b"\n")
            one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[one], lines[other] = lines[other], lines[one]
            data = b"\n".join(lines)
        elif how == 6:
            words = list(re.finditer(rb"[a-z_|<\[\]]+\d?", data))
            found = rng.choice(words) if words else None
            data = data[: found.start()] + rng.choice(WORDS) + data[found.end() :] if found else data
        else:
            data = data[:place] + rng.choice(WORDS) + data[place:]
    return data


def with_right_checksum(data: bytes) -> bytes:
    """A `.silo` file that is wrong, with a header whose checksum is right: for readers that trust it."""
    from silo.files import silo_format as form

    end = data.find(form.DATA_LINE)
    start = data.rfind(form.CHECK, 0, end)
    if end < 0 or start < 0:
        return data
    check = form.checksum(data[:start] + form.DATA_LINE)
    return data[: start + len(form.CHECK)] + check + data[start + len(form.CHECK) + 8 :]


@contextmanager
def little_room() -> Iterator[None]:
    """At most so much memory more than now: a claim beyond it is a `MemoryError`."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM_BYTES, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@functools.lru_cache(maxsize=1)
def whole(target: str, number: int) -> tuple[Path, dict[Path, bytes]]:
    """The log of this number, and its files, in the working folder: a `.silo` file holds its path, so it is short."""
    recording = a_recording(random.Random(f"{target} {number}"))
    path = Path("bag" if target == "bag" else f"x.{ENDINGS.get(target, target)}")
    if path.is_dir():
        shutil.rmtree(path)
    if target == "rows":
        from silo.files.csv_file import write_csv

        write_csv(recording, path, "rows")
    else:
        writer_for(path)(recording, path, None)
    files = sorted(path.iterdir()) if target == "bag" else sorted(Path().glob("x.*"))
    return path, {file: file.read_bytes() for file in files}


def make(target: str, number: int) -> Path:
    """The damaged log of this number, in the working folder."""
    rng = random.Random(f"{target} {number}")
    path, files = whole(target, number // WAYS)
    if target == "bag":
        shutil.rmtree(path)
        path.mkdir()
    for file, data in files.items():
        file.write_bytes(data)
    if target == "bag":
        damage_bag(sorted(files), rng)
        return path
    hurt = Path("x.csv.json") if target == "sidecar" else path
    data = damaged(files[hurt], rng)
    hurt.write_bytes(with_right_checksum(data) if target == "checked" else data)
    if target in ("csv", "rows") and number % 2:
        Path("x.csv.json").unlink()
    return path


def damage_bag(files: list[Path], rng: random.Random) -> None:
    """Damage one of the files of a bag, or take it away."""
    hurt = rng.choice(files)
    how = rng.randrange(8)
    if how == 0:
        hurt.unlink()
    elif how == 1:
        hurt.rename(hurt.with_name("other" + hurt.suffix))
    else:
        hurt.write_bytes(damaged(hurt.read_bytes(), rng))


def look_at_all(path: Path) -> None:
    """Open a log and touch every value of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        log = open_log(path)
        for name in log:
            signal = log[name]
            assert len(signal.values) == len(signal.time_ns)
            assert signal.values.dtype.kind == "V" or signal.texts.shape == signal.values.shape


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("target", TARGETS)
def test_of_a_damaged_file_come_only_errors_of_silo(target, tmp_path, monkeypatch):
    raw = []
    monkeypatch.chdir(tmp_path)
    for number in range(COUNT):
        path = make(target, number)
        try:
            # polars, which writes the tables, takes address space that it does not use
            with little_room():
                look_at_all(path)
        except SiloError:
            continue
        except Exception as error:  # noqa: BLE001 - what must not come out
            raw.append(f"{target} {number}: {type(error).__name__}: {error}")
    assert raw[:20] == []


def test_every_format_that_is_read_is_fuzzed():
    assert {one.name for one in FORMATS if one.reader} <= {"silo", "csv", "mcap", "bag"}


@pytest.mark.parametrize("count", ["1000000000000", "999999999999999999"])
def test_a_header_that_claims_more_values_than_the_file_has_is_cut_off(count, tmp_path):
    path = tmp_path / "x.silo"
    writer_for(path)(a_recording(random.Random(1)), path, None)
    head, line, rest = path.read_bytes().partition(b"(Data Type)\n")
    path.write_bytes(head + line + re.sub(rb"^(\S+ \d+) \d+", rb"\1 " + count.encode(), rest, flags=re.MULTILINE))
    with little_room():
        look_at_all(path)


def test_facts_that_claim_huge_types_are_not_believed(tmp_path):
    path = tmp_path / "x.csv"
    writer_for(path)(a_recording(random.Random(1)), path, None)
    facts = json.loads((tmp_path / "x.csv.json").read_bytes())
    facts["elements"][0]["entries"][0]["dtype"] = "|V2000000000"
    (tmp_path / "x.csv.json").write_text(json.dumps(facts))
    with little_room():
        look_at_all(path)
