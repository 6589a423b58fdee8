"""Power cuts of journals by record and replay: `python .bench/long/power_cuts.py [--replays 100000] [--seed N]`.

Random loggers are logged into a journal whose every call to the system is recorded; the power is cut behind each of
them, and sectors that were not synced are there, lost, zeroed or garbage by chance (see `tests/power_cuts.py`). Every
fifth is recovered and saved as by `silo recover`. Wrong is a value that was not logged at its tick, or a tick that had
been told as durable and is missing. Exits with 1 if any was wrong.
"""

import argparse
import os
import random
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from silo.core.elements import BufferType
from tests.power_cuts import replay


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--replays", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    tried = wrong = 0
    with tempfile.TemporaryDirectory() as base, tempfile.TemporaryDirectory() as runtime:
        os.environ["SILO_RUNTIME_DIR"] = runtime
        while tried < arguments.replays:
            folder = Path(tempfile.mkdtemp(dir=base))
            options = [
                (chance.randint(1, 3), chance.choice(list(BufferType)), chance.randint(1, 150))
                for _ in range(chance.randint(1, 4))
            ]
            batches = [chance.randint(1, 60) for _ in range(chance.randint(1, 12))]
            seed = chance.getrandbits(32)
            refusals = {chance.randrange(len(batches)): chance.randint(0, 1)} if chance.random() < 0.3 else {}
            try:
                tried += replay(folder, options, batches, seed, refusals=refusals, commands=0.2)
            except AssertionError as error:
                wrong, tried = wrong + 1, tried + 1
                print(f"wrong: {options} {batches} {refusals} seed {seed}: {error}", flush=True)
    print(f"Page-cut replays tried / wrong: {tried} / {wrong}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
