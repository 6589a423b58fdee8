"""Messages, files and help are what they were. What is meant to be new: `python -m tests.golden`, and read the diff."""

import difflib
import json
from typing import Any

import pytest
from msgspec import inspect

from tests.golden import files, keys, structs, words
from tests.golden.__main__ import FOLDER

KEPT = json.loads((FOLDER / "structs.json").read_text())
TOLD = {one.name: one for one in structs.all_told()}
FILES = sorted(path.name for path in FOLDER.glob("run.*"))


def same(before: str, now: str, what: str) -> None:
    changed = list(difflib.unified_diff(before.splitlines(), now.splitlines(), what, "now", n=1, lineterm=""))
    assert not changed, "\n".join(line[:200] for line in changed[:60])


def test_the_shape_of_every_message_and_file_is_as_it_was() -> None:
    now = structs.told()
    for part in ("requests", "shapes", "samples"):
        before, after = (json.dumps(in_order(one[part]), indent=1) for one in (KEPT, now))
        same(before, after, f"{part} of before")


def in_order(told: Any) -> Any:
    """Unions in one order: tags tell which one it is, whatever order modules are imported in."""
    if isinstance(told, dict):
        return {name: in_order(one) for name, one in told.items()}
    return " | ".join(sorted(told.split(" | "))) if isinstance(told, str) and told.startswith("<") else told


@pytest.mark.parametrize("name", KEPT["samples"])
def test_a_sample_of_before_is_read_and_comes_out_as_it_was(name) -> None:
    told, kept = TOLD[name], KEPT["samples"][name]
    data = kept.encode() if told.json else bytes.fromhex(kept)
    assert told.encode(told.decode(data)) == data


@pytest.mark.parametrize("name", KEPT["samples"])
def test_a_sample_says_something_of_every_field(name) -> None:
    kind = inspect.type_info(TOLD[name].kind)
    made = structs.sample(kind)
    defaults = {one.name for one in kind.fields if not one.required and getattr(made, one.name) == one.default}
    assert not defaults


@pytest.mark.parametrize("told", [words, keys])
def test_every_word_of_the_help_and_every_key_is_as_it_was(told) -> None:
    name = {words: "help.txt", keys: "keys.txt"}[told]
    same((FOLDER / name).read_text(), "\n".join(told.told()), f"{name} of before")


@pytest.mark.parametrize("name", FILES)
def test_a_recording_is_written_as_it_was(name, written) -> None:
    before, now = (FOLDER / name).read_bytes(), written[name]
    same(before.decode("utf-8", "backslashreplace"), now.decode("utf-8", "backslashreplace"), name)
    assert before == now


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("golden"))
        return files.written()


def test_every_format_that_is_written_is_held(written) -> None:
    assert sorted(written) == FILES
