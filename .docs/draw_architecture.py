"""Draws the pictures of `.docs/architecture.md` from the imports that the program really has.

`python .docs/draw_architecture.py` writes them anew; a test fails while the file tells something else.
"""

import re
import sys
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / ".docs" / "architecture.md"
PACKAGES = ("silo", "silo_tui")

# process -> what it runs, and what it is for
PROCESSES = {
    "robot": ("silo.logger", "robot program", "collect() once per tick"),
    "helper": ("silo.helper", "helper process", "one per logger that serves"),
    "writing": ("silo.recordings.writing", "writing process", "one per save"),
    "recorder": ("silo.recorder", "recorder", "one per endless recording"),
    "shell": ("silo.cli", "silo", "shell commands"),
    "tui": ("silo_tui", "silo-tui", "terminal"),
}
# who -> whom, by what; what the arrows carry no import tells
CHANNELS = [
    ("robot", "segment", "rows, committed by one store"),
    ("segment", "helper", "read only"),
    ("segment", "writing", "read only"),
    ("robot", "helper", "link: commands, answers"),
    ("segment", "recorder", "read only"),
    ("helper", "writing", "pipe: order, report"),
    ("helper", "recorder", "socket: order, runs, reports"),
    ("helper", "shell", "Zenoh: requests, views, topics, events"),
    ("helper", "tui", "Zenoh: requests, views, topics, events"),
    ("writing", "files", "finished, then renamed"),
    ("recorder", "files", "finished, then renamed"),
    ("files", "shell", ""),
    ("files", "tui", ""),
]


def build_graph() -> grimp.ImportGraph:
    """Return all imports, those within functions too; not those for type checkers alone."""
    sys.path.insert(0, str(ROOT))
    return grimp.build_graph(*PACKAGES, cache_dir=None, exclude_type_checking_imports=True)


def room_of(module: str) -> str:
    """Return the folder or the module on the ground floor that a module belongs to; packages themselves have none."""
    return ".".join(module.split(".")[:2]) if "." in module else ""


def imports_between_rooms(graph: grimp.ImportGraph) -> set[tuple[str, str]]:
    """Return which room imports from which."""
    pairs = {
        (room_of(module), room_of(imported))
        for module in graph.modules
        for imported in graph.find_modules_directly_imported_by(module)
    }
    return {(one, other) for one, other in pairs if one and other and one != other}


def reachable(arrows: set[tuple[str, str]]) -> dict[str, set[str]]:
    """Return for each room what it imports at any hand."""
    found = {one: {other for begin, other in arrows if begin == one} for arrow in arrows for one in arrow}
    for middle, beyond in found.items():
        for below in found.values():
            if middle in below:
                below.update(beyond)
    return found


def needed(arrows: set[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the arrows that don't follow from others; those of a circle all stay."""
    below = reachable(arrows)

    def follows(one: str, other: str) -> bool:
        return any(
            other in below[middle] and one not in below[middle] and middle not in below[other] for middle in below[one]
        )

    return sorted((one, other) for one, other in arrows if not follows(one, other))


def draw_rooms(graph: grimp.ImportGraph) -> str:
    """Return the picture of the folders: an arrow from each to those it imports from."""
    arrows = imports_between_rooms(graph)
    lines = ["flowchart TD"]
    for package in PACKAGES:
        lines.append(f"  subgraph {package}")
        lines += [f"    {room}[{room.split('.')[1]}]" for room in sorted(graph.find_children(package))]
        lines.append("  end")
    lines += [f"  {one} --> {other}" for one, other in needed(arrows)]
    return "\n".join(lines)


def draw_processes(graph: grimp.ImportGraph) -> str:
    """Return the picture of the processes: what each may load, and what passes between them."""
    lines = ["flowchart LR"]
    for name, (module, title, purpose) in PROCESSES.items():
        own = {module} | graph.find_descendants(module)
        loads = {room_of(each) for each in own | graph.find_upstream_modules(module, as_package=True)}
        folders = sorted(room[5:] for room in loads if room[:5] == "silo." and (ROOT / "silo" / room[5:]).is_dir())
        lines.append(f'  {name}["<b>{title}</b><br/>{purpose}<br/><i>{"<br/>".join(folders)}</i>"]')
    lines.append('  segment[("segment<br/>shared memory")]')
    lines.append('  files[("saved logs")]')
    lines += [f'  {one} -->|"{what}"| {other}' if what else f"  {one} --> {other}" for one, other, what in CHANNELS]
    return "\n".join(lines)


def drawn(page: str) -> str:
    """Return a page with its pictures as they are now."""
    graph = build_graph()
    for name, picture in (("processes", draw_processes(graph)), ("folders", draw_rooms(graph))):
        block = f"<!-- {name} -->\n```mermaid\n{picture}\n```\n<!-- end -->"
        page, count = re.subn(rf"<!-- {name} -->\n.*?<!-- end -->", lambda _, block=block: block, page, flags=re.DOTALL)
        if count != 1:
            raise SystemExit(f"{PAGE}: has {count} places for the picture '{name}', needs one")
    return page


if __name__ == "__main__":
    PAGE.write_text(drawn(PAGE.read_text()))
