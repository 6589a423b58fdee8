"""Random message types, written by `rosbags` and `mcap`, read by silo and value for value by `mcap-ros2-support`.

60 schemas; `SILO_SCHEMAS=2000` takes so many, `SILO_SCHEMA_SEED` others. The number of a failure makes it again.
"""

import os
import random
import struct
import warnings

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import silo

COUNT = int(os.environ.get("SILO_SCHEMAS", "60"))
SEED = int(os.environ.get("SILO_SCHEMA_SEED", "0"))
START = 1_700_000_000 * 10**9
STEP = 5_000_001
SPLIT = "=" * 80
NUMBERS = {
    "bool": "?", "byte": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
PACKINGS = ["zstd", "lz4", "none", "no chunks", "no index", "sqlite", "sqlite by message", "rosbag2"]


class Schema:
    """A message type: its definition, and CDR of random messages with the values that stand in them."""

    def __init__(self, chance, name):
        self.chance, self.name = chance, name
        self.parts, self.types = [], {}
        self.root = self.type(name, 0)

    @property
    def text(self):
        own, *others = self.parts
        return own[1] + "".join(f"{SPLIT}\nMSG: {name}\n{text}" for name, text in others)

    def type(self, name, depth):
        """Fields of a type, a third of the embedded ones without any."""
        place = len(self.parts)
        self.parts.append(None)
        fields, lines = [], []
        for number in range(self.chance.randint(1, 6) if depth == 0 or self.chance.random() < 0.67 else 0):
            label = f"f{number}"
            base = self.chance.choice([*NUMBERS, "string", "string", "Time", "message", "message"])
            if base == "message" and depth > 2:
                base = "int64"
            if base == "message":
                inner = f"my_msgs/{name.rpartition('/')[2]}X{number}"
                base = self.type(inner, depth + 1)
                word = inner
            elif base == "Time":
                word = "builtin_interfaces/Time"
            else:
                word = base + (self.chance.choice(["", "<=9"]) if base == "string" else "")
            many = self.chance.choice([None, None, None, (3, 3), (0, 4), (0, 5)])
            ending = {None: "", (3, 3): "[3]", (0, 4): "[]", (0, 5): "[<=5]"}[many]
            fields.append((label, base, many))
            lines.append(f"{word}{ending} {label}\n")
        if not fields:
            lines.append("uint8 NOTHING=0\n")
        self.parts[place] = (name, "".join(lines))
        return fields

    def message(self, little=True):
        """One message in CDR, and its values by path."""
        made, found = bytearray(), {}
        order = "<" if little else ">"

        def put(code, value):
            size = struct.calcsize(code)
            made.extend(b"\0" * (-len(made) % size))
            made.extend(struct.pack(order + code, value))

        def one(base, path):
            if isinstance(base, list):
                return several(base, path)
            if base == "string":
                text = "".join(self.chance.choice("abΩ -") for _ in range(self.chance.randint(0, 5)))
                packed = text.encode() + b"\0"
                put("I", len(packed))
                made.extend(packed)
                return text
            if base == "Time":
                second, rest = self.chance.randrange(2**31), self.chance.randrange(10**9)
                put("i", second)
                put("I", rest)
                return second * 10**9 + rest
            code = NUMBERS[base]
            if code == "?":
                value = self.chance.random() < 0.5
            elif code in "fd":
                value = struct.unpack(code, struct.pack(code, self.chance.uniform(-1e6, 1e6)))[0]
            else:
                bits = 8 * struct.calcsize(code)
                low = -(2 ** (bits - 1)) if code.islower() else 0
                value = self.chance.choice([low, low + 2**bits - 1, self.chance.randrange(low, low + 2**bits)])
            put(code, value)
            return value

        def several(fields, path):
            if not fields:
                made.append(0)  # what CDR has in place of nothing
            for label, base, many in fields:
                here = (*path, label)
                if many is None:
                    value = one(base, here)
                    if not isinstance(base, list):
                        found[here] = value
                    continue
                count = self.chance.randint(*many)
                if many[0] != many[1]:
                    put("I", count)
                before = dict(found)
                values = [one(base, here) for _ in range(count)]
                found.clear()
                found.update(before)  # of lists of messages nothing is a signal
                if not isinstance(base, list) and base != "Time":
                    found[here] = values

        several(self.root, ())
        made.extend(b"\0" * (-len(made) % 4))
        return bytes([0, int(little), 0, 0]) + bytes(made), found


def write(path, packing, topics):
    """A bag of `{topic: [(schema, log time, message), ...]}`; returns what is to be opened."""
    if packing in ("sqlite", "sqlite by message", "rosbag2"):
        plugin = StoragePlugin.MCAP if packing == "rosbag2" else StoragePlugin.SQLITE3
        writer = Writer(path / "bag", version=8, storage_plugin=plugin)
        if packing == "sqlite by message":
            writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        with writer:
            known = {}
            for topic, messages in topics.items():
                for schema, when, data in messages:
                    kind = schema.name.replace("/", "/msg/")
                    if (topic, kind) not in known:
                        store = get_typestore(Stores.EMPTY)
                        base = get_typestore(Stores.ROS2_HUMBLE)
                        store.register({"builtin_interfaces/msg/Time": base.fielddefs["builtin_interfaces/msg/Time"]})
                        store.register(get_types_from_msg(schema.text, kind))
                        known[topic, kind] = writer.add_connection(topic, kind, typestore=store)
                    writer.write(known[topic, kind], when, data)
        return path / "bag"
    kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}
    options = {"compression": kinds.get(packing, CompressionType.NONE), "chunk_size": 600}
    if packing == "no chunks":
        options["use_chunking"] = False
    if packing == "no index":
        from mcap.writer import IndexType

        options["index_types"] = IndexType.NONE
    with (path / "bag.mcap").open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2")
        known = {}
        rows = [(when, topic, schema, data) for topic, messages in topics.items() for schema, when, data in messages]
        for when, topic, schema, data in sorted(rows, key=lambda row: row[0]):
            if (topic, id(schema)) not in known:
                number = writer.register_schema(schema.name.replace("/", "/msg/"), "ros2msg", schema.text.encode())
                known[topic, id(schema)] = writer.register_channel(topic, "cdr", number)
            writer.add_message(known[topic, id(schema)], when, data, when)
        writer.finish()
    return path / "bag.mcap"


class _Record:
    encoding = "ros2msg"

    def __init__(self, schema):
        self.id, self.name, self.data = id(schema), schema.name.replace("/", "/msg/"), schema.text.encode()


def by_mcap_ros2(schema, data):
    """The values of a message by path, as the other reader has them."""
    decoded = DecoderFactory().decoder_for("cdr", _Record(schema))(data)
    found = {}

    def look(fields, value, path):
        for label, base, many in fields:
            each = getattr(value, label)
            if many is None and isinstance(base, list):
                look(base, each, (*path, label))
            elif many is None:
                found[(*path, label)] = each.sec * 10**9 + each.nanosec if base == "Time" else each
            elif not isinstance(base, list) and base != "Time":
                found[(*path, label)] = list(each)

    look(schema.root, decoded, ())
    return found


def compare(log, topic, rows):
    """Compare all values of a topic; returns how many they are."""
    compared, cut = 0, set()
    for path in rows[0]:
        name = "/".join((topic, *path))
        wanted = [row[path] for row in rows]
        if isinstance(wanted[0], list) and not any(wanted):
            assert name not in log
            continue
        if isinstance(wanted[0], list) and all(isinstance(one, int) for each in wanted for one in each):
            kind = log[name].values.dtype.kind if name in log else "left"
            if kind == "left":  # bytes without end
                continue
        values = log[name].values
        assert len(values) == len(rows), name
        for value, whole in zip(values, wanted, strict=True):
            want = whole
            if isinstance(want, list):
                got = value.tolist()
                if len(want) > len(got):
                    cut.add(name)
                    want = want[: len(got)]
                assert got[: len(want)] == want, (name, got, want)
                assert all(one is None or one == "" or one != one for one in got[len(want) :]), (name, got, want)
                compared += len(got)
            else:
                got = value.view(np.int64).item() if values.dtype.kind == "M" else value.item()
                assert got == want, (name, got, want)
                assert type(got) is type(want), (name, got, want)
                compared += 1
    told = [text for text in log.warnings if text.startswith("arrays that are longer in some messages")]
    assert all(any(name in text for text in told) for name in cut), (cut, log.warnings)
    return compared


@pytest.mark.parametrize("packing", PACKINGS)
def test_random_schemas_are_read_as_others_read_them(packing, tmp_path):
    compared = 0
    for number in range(SEED, SEED + max(1, COUNT // len(PACKINGS))):
        chance = random.Random(f"{packing} {number}")
        schema, second = Schema(chance, "my_msgs/State"), Schema(chance, "my_msgs/Other")
        little = chance.random() < 0.8
        made = [schema.message(little) for _ in range(30)]
        other = [second.message(little) for _ in range(10)]
        folder = tmp_path / str(number)
        folder.mkdir()
        topics = {"/state": [(schema, START + at * STEP, data) for at, (data, _) in enumerate(made)]}
        if not packing.startswith("sqlite") and packing != "rosbag2":
            topics["/state"] += [(second, START + 10**9 + at * STEP, data) for at, (data, _) in enumerate(other)]
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            log = silo.open_log(write(folder, packing, topics))
            try:
                for data, found in made:
                    assert by_mcap_ros2(schema, data) == found
                compared += compare(log, "/state", [found for _, found in made])
                for name in log.names("/state/*"):
                    np.testing.assert_array_equal(log[name].time_ns, START + STEP * np.arange(len(made)))
                if len(topics["/state"]) > len(made):
                    compared += compare(log, "/state#2", [found for _, found in other])
                    assert any("/state#2" in str(one.message) for one in told)
            except Exception as error:
                raise AssertionError(f"{packing} {number}: {error}") from error
        assert not [str(one.message) for one in told if "can't be read" in str(one.message)]
    print(f"{packing}: {compared} values compared")
    assert compared > 100
