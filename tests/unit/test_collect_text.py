"""The text of `collect()` is what it was: nothing that is looked for beside the loop may cost a tick anything.

`tests/data/collect.txt` has it. Who changes it on purpose measures before and after (`.bench/speed/collect.py`),
and writes it anew: `python -m tests.unit.test_collect_text`.
"""

import pathlib
import sys
import tempfile

import pytest

import silo
from silo.loop import generated_code
from tests.stand_ins.ticking import Robot

GOLDEN = pathlib.Path(__file__).parent.parent / "data" / "collect.txt"
TABLES = {
    "looping": [("a", {}), ("b", {"divider": 3}), ("c", {"action": "both"})],
    "fixed": [("a", {"buffer": "fixed", "size": 50}), ("b", {"buffer": "fixed", "divider": 2})],
    "growing": [("a", {"buffer": "growing"}), ("b", {"divider": 5})],
    "many dividers": [(f"d{n}", {"divider": n, "buffer": ("looping", "growing")[n % 2]}) for n in range(1, 8)],
}


def texts(monkeypatch, folder):
    """The text of `collect()` of each table, with arrays of silo's own and attributes."""
    found = {}
    compiled = generated_code._compiled
    for name, rows in TABLES.items():
        for threads in ("single", "serialized"):
            monkeypatch.setattr(
                generated_code,
                "_compiled",
                lambda text, key=(name, threads): found.setdefault(key, text) and compiled(text),
            )
            logger = silo.Logger("text", folder=folder, script=folder / "none.yaml", max_time=0, threads=threads)
            robot = Robot(mode=1, x=0.5)
            for element, options in rows:
                logger.array(element, 4, **{"size": 100, **options})
            logger.add(robot, attr="mode", size=100)
            logger.add(robot, attr="x", divider=4, size=100)
            logger.start()
            logger.close()
    return "".join(f"# {name}, {threads}\n{text}\n" for (name, threads), text in found.items())


@pytest.mark.skipif(not generated_code.ORDERED_STORES, reason="one line more where stores are reordered")
@pytest.mark.skipif(sys.version_info < (3, 11), reason="some lines more, for a second signal within the first one's")
def test_the_text_of_collect_is_what_it_was(monkeypatch, tmp_path):
    assert texts(monkeypatch, tmp_path) == GOLDEN.read_text()


if __name__ == "__main__":
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setenv("SILO_RUNTIME_DIR", folder)
        GOLDEN.write_text(texts(patch, pathlib.Path(folder)))
