"""Write `tests/data/golden` anew: python -m tests.golden"""

import os
import tempfile
from pathlib import Path

from tests.golden import files, keys, structs, words

FOLDER = Path(__file__).parents[1] / "data" / "golden"


def main() -> None:
    """Replace what is compared; what only has to be read, `golden/read`, stays as it was written once."""
    texts = {"help.txt": words.told(), "keys.txt": keys.told()}
    found = {"structs.json": structs.written().encode()}
    found |= {name: ("\n".join(lines) + "\n").encode() for name, lines in texts.items()}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        found |= files.written()
    for name, data in found.items():
        (FOLDER / name).write_bytes(data)


if __name__ == "__main__":
    main()
