"""Damaged log files: whatever stands in them, nothing but silo's own errors comes out, and no memory is claimed.

The number of a failure makes it again.
"""

import functools
import io
import json
import random
import re
import resource
import shutil
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode

import silo.files.bags.writer
from silo.analysis.opening import open_log
from silo.core.elements import BufferType, Entry
from silo.core.kinds import struct_text
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import FileFormatError, SiloError
from silo.files.bags.metadata import FACTS_ATTACHMENT, RecordingFacts, unpack_facts
from silo.files.formats import FORMATS, writer_for
from silo.files.mcap.index import attachment, read_index, record_at
from tests.fuzz.conftest import WAYS
from tests.rows_csv import write_rows

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
TARGETS = ["silo", "csv", "mcap", "sidecar", "rows", "checked", "bag", "dashes", "dashes beside", "attached", "told"]
TARGETS += ["parquet", "npz", "mat", "h5"]
ENDINGS = {
    "sidecar": "csv", "rows": "csv", "checked": "silo", "dashes": "silo", "dashes beside": "csv", "attached": "mcap",
    "told": "mcap",
}  # fmt: skip
SIZES = [0, 1, 7, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1]
WILD = [
    "{}", "null", "5", "-1", "[]", '""', '"<i8"', "true", "1e400", "99999999999999999999", '{"0":1}', '{"-1":3}',
    '{"0":-5}', '{"999999999999":1}', '{"0":1000000000000}', '{"0":99999999999999999999}', '{"x":1}', '{"0":"a"}',
    '{"0":null}', '{"dtype":"<i8"}', '{"dtype":"<i8","fill":3}', '{"dtype":"|V9","fill":0}', '{"dtype":"O"}',
    '{"dtype":"<u1","fill":-1}', '{"dtype":"<i1","fill":99999999999999999999}', '{"fill":1}',
    '{"dtype":"(9999999,)i8"}',
]  # fmt: skip


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


def with_told(recording: Recording) -> Recording:
    """The recording with texts that end in dashes and whole numbers that are missing: the file says which."""
    (first, *_) = recording.elements
    count = first.count
    texts = np.array([b"phase-", b"--", b"plain", b""] * count)[:count]
    numbers = np.ma.masked_array(np.arange(count) + 2**60, np.arange(count) % 3 == 0)
    made = [
        RecordedEntry(f"/log/{name}", Entry("", values.dtype.str), values)
        for name, values in (("texts", texts), ("numbers", numbers), ("small", numbers - 2**60))
    ]
    more = [replace(first, name=one.name, kind="scalar", shape=(), entries=(one,), dtype="") for one in made]
    return replace(recording, elements=[*recording.elements, *more])


def changed_facts(data: bytes, rng: random.Random) -> bytes:
    """JSON of facts with another value of one key, mostly of those that say what values are."""
    keys = [b"dashes", b"missing", b"fill", b"absent", b"count", b"first", b"divider", b"shape", b"channel", b"offset"]
    key = rng.choice([*keys[:4] * 3, *keys])
    found = list(re.finditer(rb'"' + key + rb'":\s*(\{[^{}]*\}|\[[^\[\]]*\]|[^,{}\[\]\s]+)', data))
    if not found:
        return data
    one = rng.choice(found)
    return data[: one.start(1)] + rng.choice(WILD).encode() + data[one.end(1) :]


def changed_attachment(data: bytes, rng: random.Random) -> bytes:
    """An MCAP file one of whose attachments, or what its summary says of one, announces something else."""
    at, places = 8, []
    while at + 9 <= len(data) - 8:
        if data[at] in (9, 10):
            places.append(at)
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    at = rng.choice(places)
    size = int.from_bytes(data[at + 1 : at + 9], "little")
    field = rng.choice([at + 1, at + 9, at + 17, at + 25, at + 9 + rng.randrange(max(1, size)), at + 9 + size - 12])
    width = rng.choice([4, 8])
    data = data[:field] + (rng.choice(SIZES) % 2 ** (8 * width)).to_bytes(width, "little") + data[field + width :]
    if data[at] == 9 and rng.random() < 0.5 and at + 9 + size <= len(data):
        check = zlib.crc32(data[at + 9 : at + 5 + size])
        data = data[: at + 5 + size] + check.to_bytes(4, "little") + data[at + 9 + size :]
    if rng.random() < 0.8:  # no checksum of the summary
        data = data[:-12] + bytes(4) + data[-8:]
    return data if rng.random() < 0.8 else data[: rng.randrange(at, len(data))]


def with_right_checksum(data: bytes) -> bytes:
    """A `.silo` file that is wrong, with a header whose checksum is right: for readers that trust it."""
    from silo.files.silo import format as form

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
    rng = random.Random(f"{target} {number}")
    recording = a_recording(rng)
    if target in ("dashes", "dashes beside", "attached", "told"):
        recording = with_told(recording)
    path = Path("bag" if target == "bag" else f"x.{ENDINGS.get(target, target)}")
    if path.is_dir():
        shutil.rmtree(path)
    if target == "rows":
        write_rows(recording, path)
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
    if target == "told":
        with pytest.MonkeyPatch.context() as patch:
            packed = changed_facts(msgspec.json.encode(facts_of(path)), rng)
            patch.setattr(silo.files.bags.writer, "pack_facts", lambda _: zstandard.compress(packed))
            path.unlink()
            writer_for(path)(with_told(a_recording(random.Random(f"{target} {number // WAYS}"))), path, None)
        return path
    if target in ("dashes", "dashes beside", "attached"):
        hurt = Path("x.csv.json") if target == "dashes beside" else path
        data = (changed_attachment if target == "attached" else changed_facts)(files[hurt], rng)
        hurt.write_bytes(with_right_checksum(data) if target == "dashes" else data)
        return path
    hurt = Path("x.csv.json") if target == "sidecar" else path
    data = damaged(files[hurt], rng)
    hurt.write_bytes(with_right_checksum(data) if target == "checked" else data)
    if target in ("csv", "rows") and number % 2:
        Path("x.csv.json").unlink()
    return path


def facts_of(path: Path) -> RecordingFacts:
    """What a bag of ours says of itself."""
    data = memoryview(path.read_bytes())
    index = read_index(data)
    assert index is not None
    at, _ = index.attachments[FACTS_ATTACHMENT]
    return unpack_facts(RecordingFacts, attachment(record_at(data, at, Opcode.ATTACHMENT))[2])


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
@pytest.mark.sampled
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("target", TARGETS)
def test_of_a_damaged_file_come_only_errors_of_silo(target, numbers, tmp_path, monkeypatch):
    raw = []
    monkeypatch.chdir(tmp_path)
    for number in numbers:
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


@pytest.mark.slow
def test_values_of_lengths_of_their_own_are_not_read_of_hdf5(tmp_path):
    """In a damaged heap of such values the HDF5 library turns for ever."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "x.h5"
    writer_for(path)(a_recording(random.Random(3)), path, None)
    with h5py.File(path, "r+") as store:
        stamps = store["time_ns"][()]
        del store["time_ns"]
        store.create_dataset("time_ns", data=[str(one) for one in stamps], dtype=h5py.string_dtype())
    with pytest.raises(FileFormatError, match="/time_ns has values of lengths of their own"):
        open_log(path)


def test_every_format_that_is_read_is_fuzzed():
    assert {one.name for one in FORMATS if one.reader} <= {
        "silo",
        "csv",
        "mcap",
        "bag",
        "parquet",
        "numpy",
        "matlab",
        "hdf5",
        "ulog",  # in tests/files/test_logs_of_others.py
    }


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
    with little_room(), pytest.raises(FileFormatError, match=r"was logged as \|V2000000000"):
        look_at_all(path)


def test_stamps_that_the_facts_know_nothing_of_are_not_unpacked(tmp_path):
    path = tmp_path / "x.npz"
    writer_for(path)(a_recording(random.Random(1)), path, None)
    with zipfile.ZipFile(path) as whole:
        members = {name: whole.read(name) for name in whole.namelist()}
    many = io.BytesIO()
    np.save(many, np.zeros(30_000_000, np.int64))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as hurt:
        for name, data in {**members, "time_ns.npy": many.getvalue()}.items():
            hurt.writestr(name, data)
    with little_room(), pytest.raises(FileFormatError, match=r"has 30,000,0.. time stamps, and says that it has"):
        look_at_all(path)
