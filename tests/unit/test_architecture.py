"""The pictures of the architecture tell what the program is now."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def drawing():
    """The script that draws them."""
    spec = importlib.util.spec_from_file_location("draw_architecture", ROOT / ".docs" / "draw_architecture.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_pictures_are_those_of_the_imports_that_there_are(drawing):
    page = drawing.PAGE.read_text()
    assert drawing.drawn(page) == page, "run: python .docs/draw_architecture.py"


def test_an_arrow_that_follows_from_others_is_left_out(drawing):
    assert drawing.needed({("a", "b"), ("b", "c"), ("a", "c")}) == [("a", "b"), ("b", "c")]


def test_all_arrows_of_a_circle_are_drawn(drawing):
    circle = {("a", "b"), ("b", "c"), ("c", "a")}
    assert drawing.needed({*circle, ("c", "d")}) == sorted({*circle, ("c", "d")})


def test_every_folder_and_module_is_in_the_picture_and_in_the_table(drawing):
    page = drawing.PAGE.read_text()
    for path in (ROOT / "silo").iterdir():
        if path.name not in ("__init__.py", "__pycache__", "py.typed", "config"):
            assert f"    silo.{path.stem}[{path.stem}]" in page
            assert f"silo/{path.name}" in page or f" {path.name}" in page


def test_folders_that_the_table_names_within_a_room_are_there(drawing):
    rows = re.findall(r"^\| `(silo\S*)/` \| (.*) \|$", drawing.PAGE.read_text(), re.MULTILINE)
    named = [
        (room, name)
        for room, words in rows
        for names in re.findall(r"`((?:\w+/ ?)+)`", words)
        for name in names.split()
    ]
    assert len(named) > 20
    assert [(room, name) for room, name in named if not any((ROOT / room).rglob(name.strip("/")))] == []


def test_links_lead_to_files_that_there_are(drawing):
    pages = [ROOT / "README.md", *(ROOT / ".docs").rglob("*.md"), *(ROOT / ".github").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text())]
    assert links
    assert [(page, link) for page, link in links if not (page.parent / link).exists()] == []
