"""Write `tests/data/golden` anew: python -m tests.golden"""

import os
import tempfile
from pathlib import Path

from tests.golden import files, structs, words

FOLDER = Path(__file__).parents[1] / "data" / "golden"


def main() -> None:
    """Replace what is compared; what only has to be read, `golden/read`, stays as it was written once."""
    found = {"structs.json": structs.written().encode(), "help.txt": ("\n".join(words.told()) + "\n").encode()}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        found |= files.written()
    for name, data in found.items():
        (FOLDER / name).write_bytes(data)


if __name__ == "__main__":
    main()
