"""Variables that come together, each with a name, a unit and a kind of its own: `log.add` takes all of them or none."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Variable:
    """One of them, as `log.add` takes it."""

    source: object
    name: str
    unit: str = "-"
    kind: str = ""


@dataclass(frozen=True)
class Variables:
    """What `log.add` takes in place of a variable; `origin` is the call that made them."""

    origin: str
    each: tuple[Variable, ...]
