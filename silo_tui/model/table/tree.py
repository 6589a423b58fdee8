"""The lines of a table: elements, the name spaces that hold them as branches, and the entries of unfolded vectors.

A line is a number: an element's row itself; `-1 - b` for branch b; `row + (entry + 1) * ENTRY` for an entry of it.
"""

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

Lines = NDArray[np.int64]
Rows = NDArray[np.intp]
ENTRY = 2**32


class Branch(msgspec.Struct, frozen=True):
    """A name space: its path, how deep it lies, and the elements below it that are shown."""

    path: str
    depth: int
    rows: Rows

    @property
    def label(self) -> str:
        """The last level of its path."""
        return self.path.rpartition("/")[2]


class Tree(msgspec.Struct, frozen=True):
    """Lines with what their branches are and how deep each line lies."""

    lines: Lines
    branches: tuple[Branch, ...] = ()
    depths: tuple[int, ...] = ()

    def depth(self, position: int) -> int:
        """Return how deep a line lies; 0 in a list."""
        return self.depths[position] if self.depths else 0


def row_of(line: int) -> int | None:
    """Return the element of a line; None for a branch."""
    return None if line < 0 else int(line % ENTRY)


def entry_of(line: int) -> int | None:
    """Return the number of the entry that a line shows; None for a whole element or a branch."""
    return int(line // ENTRY) - 1 if line >= ENTRY else None


def list_of(shown: Rows, unfolded: Mapping[int, int]) -> Tree:
    """Return the lines of a list; `unfolded` has the number of entries of the vectors that are unfolded."""
    if not unfolded:
        return Tree(shown.astype(np.int64))
    lines: list[int] = []
    for row in shown.tolist():
        lines.append(row)
        lines += (row + (entry + 1) * ENTRY for entry in range(unfolded.get(row, 0)))
    return Tree(np.array(lines, np.int64))


def parts_of(name: str) -> list[str]:
    """Return the levels of a name as it is shown."""
    return name.lstrip("/").split("/")


def tree_of(shown: Rows, names: Sequence[str], folded: frozenset[str], unfolded: Mapping[int, int]) -> Tree:
    """Return the lines of a tree; `shown` in the order of the tree, `names` those of all elements as they are shown."""
    lines: list[int] = []
    depths: list[int] = []
    members: list[list[int]] = []
    places: list[tuple[str, int]] = []
    open_branches: list[tuple[str, int]] = []  # (path, number) from the root to the present one
    hidden_from = -1  # depth of the folded branch that hides what follows
    for row in shown.tolist():
        levels = parts_of(names[row])
        path = ""
        for depth, level in enumerate(levels[:-1]):
            path = f"{path}/{level}"
            if depth < len(open_branches) and open_branches[depth][0] == path:
                continue
            del open_branches[depth:]
            if hidden_from >= depth:
                hidden_from = -1
            number = len(places)
            open_branches.append((path, number))
            places.append((path, depth))
            members.append([])
            if hidden_from < 0:
                lines.append(-1 - number)
                depths.append(depth)
                if path in folded:
                    hidden_from = depth
        del open_branches[len(levels) - 1 :]
        if hidden_from >= len(open_branches):
            hidden_from = -1
        for _, number in open_branches:
            members[number].append(row)
        if hidden_from < 0:
            entries = unfolded.get(row, 0)
            lines += (row, *(row + (entry + 1) * ENTRY for entry in range(entries)))
            depths += [len(levels) - 1] + [len(levels)] * entries
    branches = tuple(
        Branch(path, depth, np.array(rows, np.intp)) for (path, depth), rows in zip(places, members, strict=True)
    )
    return Tree(np.array(lines, np.int64), branches, tuple(depths))
