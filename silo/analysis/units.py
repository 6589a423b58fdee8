"""What becomes of units when signals are calculated with. `-` is no unit."""

_NONE = ("", "-")


def unit_of(one: str, other: str, sign: str) -> str:
    """Unit of `one sign other`; a sum of different units has none."""
    if sign == "*":
        return product(one, other)
    if sign == "/":
        return quotient(one, other)
    if other in (one, *_NONE):
        return one
    return other if one in _NONE else "-"


def product(one: str, other: str) -> str:
    """`Nm` and `rad/s`: `Nm*rad/s`."""
    return "*".join(unit for unit in (one, other) if unit not in _NONE) or "-"


def quotient(one: str, other: str) -> str:
    """`rad` and `s`: `rad/s`."""
    if other in _NONE:
        return one
    if one == other:
        return "-"
    return f"{'1' if one in _NONE else one}/{other}"
