"""Damages segments and reads them: FOLDER SEED NUMBER... Prints what is no SegmentError, and how many were tried.

A process of its own, so that a signal, endless reading or a bomb ends it and not the tests.
"""

import json
import os
import random
import resource
import signal
import sys
import traceback
from pathlib import Path

import numpy as np

import silo
from silo.core.elements import Action, BufferType
from silo.core.runtime import boot_id
from silo.errors import SaveError, SegmentError
from silo.helper.left_logs import recover
from silo.journal.holdings import segment_holdings
from silo.recovery.left import damage
from silo.recovery.segments import left_segments
from silo.segment.layout import LINE_WORDS, HeaderWord
from silo.segment.reader import SegmentReader
from silo.segment.rows import lost_samples

MEMORY_BYTES = 4 << 30  # of addresses; what is taken in good faith is far less
SECONDS = 10  # of the processor, for one input
WILD = [
    0,
    1,
    2,
    7,
    8,
    4095,
    4096,
    4097,
    2**16,
    2**31,
    2**32 - 1,
    2**53,
    2**62,
    2**63 - 1,
    2**63,
    2**64 - 4096,
    2**64 - 1,
]
WILD_JSON = [None, True, -1, 0, 1, 2, 7, 2**31, 2**62, 2**70, -(2**63), 1e308, -0.5, "", "x", "|O", "<f8", "|S0", "|V8",
             "<M8[ns]", "../../x", "\x00", "ä" * 300, [], {}, [[[]]]]  # fmt: skip


class Thing:
    """Something with attributes that can be read, and one that can't at times."""

    value = 1.5
    count = 7


def write_segments(folder: Path) -> list[bytes]:
    """Valid segments of all that a segment may hold: every buffer, types, strings, failures, several chunks."""
    made = []
    for number, max_time in enumerate((1, 0, 0)):
        thing = Thing()
        log = silo.Logger(
            f"f{number}", folder=folder, script=folder / "none.yaml", max_time=max_time, memory_limit_mb=4
        )
        for kind in BufferType if not max_time else (BufferType.FIXED, BufferType.LOOPING):
            log.array(f"{kind.name}_3", 3, buffer=kind, size=20, action=Action.SAVE_AND_PUBLISH)
            log.array(f"{kind.name}_slow", (2, 2), np.float32, buffer=kind, size=9, divider=3)
        log.array("word", (), "S5", size=12)
        log.array("when", (), "<M8[ns]", size=12)
        log.array("seen", (), np.int16, action=Action.PUBLISH, size=3)
        log.add(thing, attr="value", name="value", size=30)
        if number == 2:
            log.array("wide", 4000, buffer=BufferType.GROWING, size=1)
        log.start()
        for tick in range(60):
            if tick == 20:
                del Thing.value
            if tick == 25:
                Thing.value = 2.5
            log.collect()
        path = Path(log._present.path)
        made.append(path.read_bytes())
        log.close()
    return made


def mutated(data: bytes, dice: random.Random) -> bytearray:
    """A damaged copy, by one to three of the ways in which files are damaged, or made to be."""
    out = bytearray(data)
    ways = [flip_bits, set_header, set_control, set_directory, change_schema, change_schema, scramble_schema, cut, zero]
    for _ in range(dice.randint(1, 3)):
        dice.choice(ways)(out, dice)
    return out


def header(out: bytearray, word: HeaderWord) -> int:
    return int.from_bytes(out[8 * word : 8 * word + 8], "little")


def put(out: bytearray, offset: int, value: int) -> None:
    if 0 <= offset <= len(out) - 8:
        out[offset : offset + 8] = (value % 2**64).to_bytes(8, "little")


def wild(dice: random.Random) -> int:
    return dice.choice([dice.choice(WILD), dice.getrandbits(64), dice.randrange(100_000)])


def flip_bits(out: bytearray, dice: random.Random) -> None:
    for _ in range(dice.choice([1, 1, 10, 1000])):
        place = dice.randrange(min(len(out), dice.choice([64, 8192, 65_536, len(out)])))
        out[place] ^= 1 << dice.randrange(8)


def set_header(out: bytearray, dice: random.Random) -> None:
    put(out, 8 * dice.choice(list(HeaderWord)[1:]), wild(dice))


def set_control(out: bytearray, dice: random.Random) -> None:
    put(out, header(out, HeaderWord.CONTROL_OFFSET) + 8 * dice.randrange(LINE_WORDS * 14), wild(dice))


def set_directory(out: bytearray, dice: random.Random) -> None:
    put(
        out,
        header(out, HeaderWord.CHUNKS_OFFSET) + 8 * dice.randrange(12),
        dice.choice([wild(dice), dice.randrange(12)]),
    )


def cut(out: bytearray, dice: random.Random) -> None:
    del out[dice.randrange(min(len(out), dice.choice([9000, 100_000, len(out)]))) :]


def zero(out: bytearray, dice: random.Random) -> None:
    pages = len(out) // 4096
    if pages:
        first = dice.randrange(pages)
        last = min(pages, first + dice.choice([1, 3, 60]))
        out[4096 * first : 4096 * last] = bytes(4096 * (last - first))


def change_schema(out: bytearray, dice: random.Random) -> None:
    """One value of the description becomes another, so that it is still JSON."""
    begin, size = header(out, HeaderWord.SCHEMA_OFFSET), header(out, HeaderWord.SCHEMA_BYTES)
    try:
        schema = json.loads(out[begin : begin + size])
    except (ValueError, RecursionError):
        return
    place: object = schema
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            return
        key = dice.choice(keys)
        if isinstance(place[key], dict | list) and place[key] and dice.random() < 0.9:
            place = place[key]
            continue
        old = place[key]
        if isinstance(old, int) and dice.random() < 0.5:
            place[key] = dice.choice([old - 1, old + 1, 8 * old, -old, wild(dice)])
        elif isinstance(place, list) and dice.random() < 0.3:
            place.insert(key, old) if dice.random() < 0.5 else place.pop(key)
        else:
            place[key] = dice.choice(WILD_JSON)
        break
    body = json.dumps(schema).encode()
    room = header(out, HeaderWord.CONTROL_OFFSET) - begin
    if len(body) <= room < len(out):
        out[begin : begin + len(body)] = body
        put(out, 8 * HeaderWord.SCHEMA_BYTES, len(body))


def scramble_schema(out: bytearray, dice: random.Random) -> None:
    begin, size = header(out, HeaderWord.SCHEMA_OFFSET), header(out, HeaderWord.SCHEMA_BYTES)
    junk = dice.choice([b"[" * 5000, b"\xff\xfe", b'"', b"{}", b"1e999", b"\\ud800", bytes(20), b"9" * 30])
    if 0 < size < len(out) and begin < len(out):
        place = min(begin + dice.randrange(size), len(out))
        end = min(len(out), place + len(junk))
        out[place:end] = junk[: end - place]


def attempt(path: Path, folder: Path, *, save: bool) -> bool:
    """Everything that is done with a segment that was found; whether it could be read."""
    stale = left_segments()
    assert len(stale) <= 1, stale
    try:
        reader = SegmentReader(path)
        try:
            reader.alive()
            segment_holdings(reader)
            reader.snapshot()
            damage(reader)
            _ = reader.last_time_ns, lost_samples(reader), reader.stop_reason, reader.size_bytes
            for ring in reader.schema.rings:
                reader.rows(ring.ring, 0)
        finally:
            reader.close()
        if save:
            recover(path, folder)
    except (SegmentError, SaveError):
        return False
    return True


def out_of_time(_number: int, _frame: object) -> None:
    raise TimeoutError(f"reads for {SECONDS} s and more")


def main() -> int:
    folder, seed, numbers = Path(sys.argv[1]), int(sys.argv[2]), list(map(int, sys.argv[3:]))
    valid = write_segments(folder)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGPROF, out_of_time)
    path = Path(os.environ["SILO_RUNTIME_DIR"]) / "f.1.0.segment"
    failed = refused = 0
    for number in numbers:
        dice = random.Random(seed + number)
        # of another boot, so that its writer is gone: else nothing would be recovered
        data = dice.choices(valid, (12, 4, 1))[0].replace(boot_id().encode(), b"0" * len(boot_id()), 1)
        path.write_bytes(mutated(data, dice))
        try:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            refused += not attempt(path, folder, save=number % 4 == 0)
            signal.setitimer(signal.ITIMER_PROF, 0)
        except Exception:  # noqa: BLE001  # whatever it is, it is what is looked for
            failed += 1
            print(f"--- input {number}\n{traceback.format_exc()}", flush=True)
        path.unlink(missing_ok=True)
    print(f"{len(numbers)} inputs, {refused} refused, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
