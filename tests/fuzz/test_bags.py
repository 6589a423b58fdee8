"""Bags that others wrote, damaged: nothing but silo's own errors comes out, soon, and without much memory.

Damage is in the file, in a message before it is packed, or in what a chunk, a record or a definition announces.
`SILO_FUZZ_SEED` takes others.
"""

import functools
import json
import os
import random
import shutil
import struct
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from silo.analysis.opening import open_log
from silo.core.recording import has_own_stamps
from silo.errors import SiloError
from tests.fuzz.conftest import WAYS

SEED = os.environ.get("SILO_FUZZ_SEED", "")
START = 1_700_000_000 * 10**9
SPLIT = "=" * 80
TYPES = {
    "my_msgs/msg/Number": "float64 data\n",
    "my_msgs/msg/Text": "string<=20 text\nint64[] list\nuint8 last\n",
    "my_msgs/msg/Deep": f"my_msgs/Nothing[] many\nmy_msgs/Point[] points\nstring[] names\nfloat32[3] xyz\n{SPLIT}\n"
    f"MSG: my_msgs/Nothing\nuint8 A=1\n{SPLIT}\nMSG: my_msgs/Point\nuint8 a\nfloat64 b\nstring c\n",
    "sensor_msgs/msg/Temperature": "",
}
HUGE = [0, 1, 255, 2**16, 2**24, 2**26, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1]
TARGETS = ["mcap", "json", "sqlite", "folder", "pages"]


def packed(code, *values):
    return struct.pack("<" + code, *values)


def text(rng):
    data = bytes(rng.choice(b"ab \xc3") for _ in range(rng.randrange(12))) + b"\0"
    return packed("I", len(data)) + data


def aligned(*parts):
    """CDR of fields, each with the size that it is aligned by."""
    made = b""
    for size, data in parts:
        made += bytes(-len(made) % size) + data
    return b"\0\1\0\0" + made


def a_message(kind, rng):
    if kind == "my_msgs/msg/Number":
        return aligned((8, packed("d", rng.random())))
    if kind == "my_msgs/msg/Text":
        count = rng.randrange(5)
        numbers = [rng.randrange(-(2**63), 2**63) for _ in range(count)]
        rest = [(8, packed(f"{count}q", *numbers))] if count else []
        return aligned((4, text(rng)), (4, packed("I", count)), *rest, (1, b"\7"))
    if kind == "my_msgs/msg/Deep":
        points = [[(1, b"\1"), (8, packed("d", 1.5)), (4, text(rng))] for _ in range(rng.randrange(3))]
        names = [(4, text(rng)) for _ in range(rng.randrange(3))]
        head = [
            (4, packed("I", 2) + bytes(2)),
            (4, packed("I", len(points))),
            *(part for one in points for part in one),
        ]
        return aligned(*head, (4, packed("I", len(names))), *names, (4, packed("3f", 1, 2, 3)))
    return aligned((4, packed("iI", 1_700_000_000, 5)), (4, text(rng)), (8, packed("2d", 20.5, 0)))


def a_value(rng, depth=0):
    kind = rng.randrange(11 if depth < 4 else 8)
    if kind < 3:
        return rng.choice([0, 1, -1, 2**53 + 1, 2**63, 2**64, -(2**63) - 1, rng.randrange(100), 10**400])
    if kind < 5:
        return rng.choice([0.5, float("nan"), float("inf"), True, False, None])
    if kind == 5:
        return rng.choice(["", "text", "\ud800", "x" * rng.randrange(3000)])
    if kind < 8:
        return [a_value(rng, 9) for _ in range(rng.randrange(4))]
    return {rng.choice("abcd"): a_value(rng, depth + 1) for _ in range(rng.randrange(5))}


def a_json(rng):
    message = {"x": rng.randrange(2**62), "v": [1, 2, rng.randrange(3)], "deep": {"on": True, "text": "a"}}
    if rng.random() < 0.2:
        message[rng.choice("xvzdeep")] = a_value(rng)
    data = json.dumps(message).encode()
    if rng.random() < 0.02:
        data = rng.choice([b"[" * 50_000, b'{"a":' * 50_000, b"", b"\xff", b"null", b"3", b"9" * 6000])
    return data


def hurt(data, rng):
    """A message with one thing wrong."""
    place = rng.randrange(len(data) + 1)
    how = rng.randrange(5)
    if how == 0:
        return data[:place]
    if how == 1:
        return data + bytes(rng.randrange(9))
    if how == 2 and len(data) >= 8:
        place = rng.randrange(0, len(data) - 3, 4)
        return data[:place] + packed("I", rng.choice(HUGE[:8])) + data[place + 4 :]
    if how == 3:
        return bytes(rng.randrange(256) for _ in range(rng.randrange(40)))
    return data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :]


@functools.cache
def typestore():
    store = get_typestore(Stores.ROS2_HUMBLE)
    for kind, definition in TYPES.items():
        if definition:
            store.register(get_types_from_msg(definition, kind))
    return store


def messages(target, rng):
    """Topic, type, time and bytes."""
    bad = rng.choice([0, 0, 0.05, 0.5])
    for at in range(rng.randrange(1, 40)):
        kind = "json" if target == "json" else rng.choice(list(TYPES))
        data = a_json(rng) if target == "json" else a_message(kind, rng)
        yield f"/{kind[-4:].lower()}", kind, START + at * 10**7, hurt(data, rng) if rng.random() < bad else data


def write_mcap(path, target, rng):
    options = {
        "compression": rng.choice(list(CompressionType)),
        "chunk_size": rng.choice([200, 1000, 100_000]),
        "index_types": rng.choice([IndexType.ALL, IndexType.ALL, IndexType.NONE]),
        "use_chunking": rng.random() < 0.9,
        "use_statistics": rng.random() < 0.8,
    }
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start()
        known = {}
        for topic, kind, when, data in messages(target, rng):
            topic = "/same" if rng.random() < 0.02 else topic  # noqa: PLW2901
            if (topic, kind) not in known:
                how = ("jsonschema", "json") if kind == "json" else ("ros2msg", "cdr")
                schema = writer.register_schema(kind, how[0], TYPES.get(kind, "{}").encode())
                known[topic, kind] = writer.register_channel(topic, how[1], schema)
            writer.add_message(known[topic, kind], when, data, when)
        writer.finish()


def write_rosbag(path, target, rng):
    plugin = StoragePlugin.SQLITE3 if target in ("sqlite", "pages") else StoragePlugin.MCAP
    writer = Writer(path, version=8, storage_plugin=plugin)
    if rng.random() < 0.3:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        known = {}
        for topic, kind, when, data in messages(target, rng):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=typestore())
            writer.write(known[topic], when, data)


def records(data):
    """Where records of the file begin, and their opcodes."""
    at = 8
    while at + 9 <= len(data) - 8:
        yield at, data[at]
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")


@functools.lru_cache
def _inflated(size, filling):
    whole_size = size // len(filling) * len(filling)
    return whole_size, zstandard.compress(filling * (size // len(filling)))


def announced(data, rng):
    """The file with a record that says something else of itself."""
    found = list(records(data))
    if not found:
        return data
    place, _ = rng.choice(found)
    chunks = [one for one, kind in found if kind == 6]
    how = rng.randrange(4)
    if how == 0 or not chunks:
        field = place + 1 if rng.random() < 0.3 else place + 9 + rng.randrange(0, 40)
        size = rng.choice([2, 4, 8])
        return data[:field] + (rng.choice(HUGE) % 2 ** (8 * size)).to_bytes(size, "little") + data[field + size :]
    place = rng.choice(chunks)
    if how == 1:
        return data[: place + 25] + packed("Q", rng.choice(HUGE)) + data[place + 33 :]
    # a chunk that is whole and unpacks to much more than it takes
    # the large ones, half of the time that all of this took, are some of many
    size = rng.choice([*[1 << 20] * 9, 30 << 20, 63 << 20, 100 << 20])
    size, content = _inflated(size, rng.choice([bytes(9), packed("BQ", 0x80, 0), packed("BQHIQQ", 5, 22, 1, 0, 0, 0)]))
    body = packed("QQQII", START, START, size, 0, 4) + b"zstd" + packed("Q", len(content)) + content
    chunk = packed("BQ", 6, len(body)) + body
    end = place + 9 + int.from_bytes(data[place + 1 : place + 9], "little")
    return data[:place] + chunk * rng.choice([1, 1, 30]) + data[end:]


def other_pages(data, rng):
    """A database of SQLite with pages, cells or a head that say something else of themselves."""
    size = int.from_bytes(data[16:18], "big") or 4096
    made = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5])):
        page = rng.randrange(max(1, len(data) // size))
        head = page * size + (100 if page == 0 else 0)
        cells = int.from_bytes(made[head + 3 : head + 5], "big")
        cell = head + 8 + 2 * rng.randrange(max(1, min(cells, size // 4)))
        how = rng.randrange(7)
        if how == 0:  # of the file: page size, versions, free pages, schema, encoding
            place, width = rng.choice([(16, 2), (18, 1), (20, 1), (28, 4), (32, 4), (44, 4), (56, 4), (96, 4)])
        elif how == 1:  # of a page: kind, free block, cells, where they begin, fragments, right child
            place, width = rng.choice([(0, 1), (1, 2), (3, 2), (5, 2), (7, 1), (8, 4)])
            place += head
        elif how == 2:  # where a cell is
            place, width = cell, 2
        elif how < 6:  # in a cell: its size, its number, the sizes of its columns
            begin = page * size + int.from_bytes(made[cell : cell + 2], "big")
            place, width = begin + rng.randrange(24), rng.choice([1, 1, 2, 9])
        else:
            other = rng.randrange(max(1, len(data) // size))
            made[page * size : (page + 1) * size] = data[other * size : (other + 1) * size]
            continue
        value = rng.choice([b"\0" * 9, b"\xff" * 9, b"\x80" * 8 + b"\1", b"\x7f" * 9, rng.randbytes(9)])
        made[place : place + width] = value[:width]
    return bytes(made[: len(data)])


def flipped(data, rng):
    for _ in range(rng.choice([1, 1, 3, 20])):
        place = rng.randrange(len(data))
        how = rng.randrange(4)
        if how == 0:
            data = data[:place]
        elif how == 1:
            data = data[:place] + data[place + rng.randint(1, 64) :]
        else:
            data = data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :]
        if not data:
            break
    return data


@functools.lru_cache(maxsize=1)
def whole(target, number):
    """The bag of this number as it was written, in the working folder, and its files."""
    path = Path("bag" if target in ("sqlite", "folder", "pages") else "bag.mcap")
    if path.is_dir():
        shutil.rmtree(path)
    (write_mcap if path.suffix else write_rosbag)(path, target, random.Random(f"bags {SEED} {target} {number}"))
    return path, {file: file.read_bytes() for file in (sorted(path.iterdir()) if path.is_dir() else [path])}


def make(target, number):
    """The damaged bag of this number, in the working folder."""
    path, files = whole(target, number // WAYS)
    rng = random.Random(f"bags {SEED} {target} {number} damaged")
    for file in [] if path.suffix else path.iterdir():
        file.unlink()  # sqlite leaves others beside its own
    for file, data in files.items():
        file.write_bytes(data)
    hurt_file = path if path.suffix else rng.choice([list(files)[-1], *files])
    data = hurt_file.read_bytes()
    if target == "pages":
        hurt_file = next(path.glob("*.db3"))
        hurt_file.write_bytes(other_pages(hurt_file.read_bytes(), rng))
        return path
    how = rng.randrange(6)
    if how == 0 and data[:5] == b"\x89MCAP":
        hurt_file.write_bytes(announced(data, rng))
    elif how < 4:
        hurt_file.write_bytes(flipped(data, rng))
    return path


def look_at_all(path, number):
    """Open a bag and touch all of it, as the commands do."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        log = open_log(path, stamps="header" if number % 5 == 0 else "log")
        for name in log:
            signal = log[name]
            assert len(signal.values) == len(signal.time_ns)
            assert signal.texts.shape == signal.values.shape
        if number % 3 == 0 and has_own_stamps(log.recording) and 0 < log.duration_s < 100:
            log.resample(50).save(Path("out.silo"), overwrite=True)
            Path("out.silo").unlink()
        if number % 7 == 0 and len(log):
            log.to_pandas()
            log.clip(0, 0.1)


def raw_errors(target, numbers):
    """What came out of bags that is no error of silo, and how long the longest took."""
    raw, longest = [], (0.0, 0)
    for number in numbers:
        path = make(target, number)
        begin = time.process_time()
        try:
            look_at_all(path, number)
        except SiloError:
            pass
        except Exception as error:  # noqa: BLE001 - what must not come out
            raw.append(f"{target} {number}: {type(error).__name__}: {error}")
        longest = max(longest, (time.process_time() - begin, number))
    return raw, longest


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("target", TARGETS)
def test_of_a_damaged_bag_of_others_come_only_errors_of_silo(target, numbers, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw, _ = raw_errors(target, numbers)
    assert raw[:20] == []


def test_what_is_whole_of_a_bag_that_is_fuzzed_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = random.Random(1)
    write_mcap(Path("bag.mcap"), "mcap", rng)
    log = open_log("bag.mcap")
    assert len(log) > 5
    assert all(np.isfinite(signal.values).all() for signal in log.glob("*/data"))
