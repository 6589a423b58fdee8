"""Stretches of ticks, both ends included."""

from collections.abc import Iterable

from silo.core.quantities.writing import many

Span = tuple[int, int]
_MOST_SHOWN = 5


def merged(spans: Iterable[Span]) -> list[Span]:
    """Return the stretches in order, those that touch or overlap as one."""
    found: list[Span] = []
    for first, last in sorted(spans):
        if found and first <= found[-1][1] + 1:
            found[-1] = (found[-1][0], max(found[-1][1], last))
        else:
            found.append((first, last))
    return found


def without(spans: Iterable[Span], others: Iterable[Span]) -> list[Span]:
    """Return what stretches have that others lack."""
    left: list[Span] = []
    taken = merged(others)
    for first, last in merged(spans):
        begin = first
        for other_first, other_last in taken:
            if other_last < begin or other_first > last:
                continue
            if other_first > begin:
                left.append((begin, other_first - 1))
            begin = other_last + 1
        if begin <= last:
            left.append((begin, last))
    return left


def doubled(spans: Iterable[Span]) -> list[Span]:
    """Return what stands in more than one of the stretches."""
    found: list[Span] = []
    end = -1
    for first, last in sorted(spans):
        if first <= end:
            found.append((first, min(last, end)))
        end = max(end, last)
    return merged(found)


def spans_text(spans: Iterable[Span], count: int | None = None) -> str:
    """Return the stretches as words: `12 ticks (3-9, 20-24)`; with the count of all where these are not all of them."""
    found = list(spans)
    shown = [str(first) if first == last else f"{first}-{last}" for first, last in found[:_MOST_SHOWN]]
    more = ", ..." if len(found) > _MOST_SHOWN else ""
    count = sum(last + 1 - first for first, last in found) if count is None else count
    return f"{many(count, 'tick')} ({', '.join(shown)}{more})"
