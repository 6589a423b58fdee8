"""What is found in a log folder: verdicts, and how much of each run stands where."""

import msgspec

from silo.core.arrays.spans import Span

MOST_SHOWN = 5


class Verdict(msgspec.Struct, frozen=True, omit_defaults=True):
    """Something that is not as it should be, or that was told to be so.

    `kind`: "missing", "twice", "disagrees", "damaged", or "not kept": what nobody had asked to be; "not recorded": what
    came while somebody had stopped a recording; "newest": looping buffers that hold less of a run than others, as they
    were asked to. `spans` are ticks of `run`, both ends included.
    `told` says who told it; empty: nobody did.
    """

    kind: str
    text: str
    logger: str = ""
    run: str = ""
    spans: tuple[Span, ...] = ()
    told: str = ""


class RunCovered(msgspec.Struct, frozen=True):
    """A run: how many ticks of it are known to be collected, and how many of these stand where."""

    logger: str
    run: str
    ticks: int
    recorded: int
    saved: int
    captured: int
    in_memory: int


class Verified(msgspec.Struct, frozen=True):
    """What was found. `problems` are what nobody told, `told` what somebody did.

    `not_kept` are ticks that stand nowhere any more, and were to be kept by nobody, and those that came while somebody
    had stopped a recording; `newest` tells of elements of which less is there than of others of their run, as their
    buffers are shorter.
    """

    folder: str
    runs: tuple[RunCovered, ...]
    problems: tuple[Verdict, ...]
    told: tuple[Verdict, ...]
    not_kept: tuple[Verdict, ...] = ()
    newest: tuple[Verdict, ...] = ()
