"""The lines of a table: elements, the name spaces that hold them as branches, and the entries of unfolded vectors.

A line is a number: an element's row itself; `-1 - b` for branch b; `row + (entry + 1) * ENTRY` for an entry of it.
"""

import itertools
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
    branches: list[tuple[str, int, list[int]]] = []  # path, depth and elements
    within: list[tuple[str, int, list[int]]] = []  # those that hold the present element, from the root on
    space, hidden = "", False
    for row in shown.tolist():
        levels = parts_of(names[row])[:-1]
        if (now := "/".join(["", *levels])) != space:
            space, paths = now, list(itertools.accumulate(levels, "{}/{}".format, initial=""))[1:]
            while len(within) > len(paths) or (within and within[-1][0] != paths[len(within) - 1]):
                within.pop()
            hidden = any(path in folded for path, _, _ in within)
            for depth, path in enumerate(paths[len(within) :], len(within)):
                if not hidden:
                    lines.append(-1 - len(branches))
                    depths.append(depth)
                within.append((path, depth, []))
                branches.append(within[-1])
                hidden = hidden or path in folded
        for _, _, rows in within:
            rows.append(row)
        if not hidden:
            entries = unfolded.get(row, 0)
            lines += (row, *(row + (entry + 1) * ENTRY for entry in range(entries)))
            depths += [len(within)] + [len(within) + 1] * entries
    made = tuple(Branch(path, depth, np.array(rows, np.intp)) for path, depth, rows in branches)
    return Tree(np.array(lines, np.int64), made, tuple(depths))
