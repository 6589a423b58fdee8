"""Which samples of an element are not what the program had, because its attribute or function could not be read.

They are counted where they happen, in the segment: a block of 256 bytes per element that is read by an expression, so
that the count outlives the program, and a loop whose sources work pays nothing for it.

    count        ticks at which the element could not be read
    spans        stretches of such ticks ever begun; above 40 bits how long a text was at most that was cut to its room
    first, last  of up to 15 stretches: the first eight, then the newest seven, going round

A stretch joins failures at due ticks that follow one another.
"""

from collections.abc import Sequence

from silo.core.recording import NO_FAILURES, Failures

BLOCK_WORDS = 32
_COUNT, _SPANS, _FIRST = 0, 1, 2
_OLDEST, _NEWEST = 8, 7
_CUT_BITS = 40
_COUNTED, _LONGEST = (1 << _CUT_BITS) - 1, (1 << 20) - 1


def record_failure(words: "memoryview[int]", block: int, tick: int, divider: int) -> None:
    """Count a failure at `tick` in the block at word `block`; a tick that is counted already counts once."""
    spans = words[block + _SPANS] & _COUNTED
    if spans:
        place = _place(block, spans - 1)
        last = words[place + 1]
        if last >= tick:
            return
        if last + divider == tick:
            words[place + 1] = tick
            words[block + _COUNT] += 1
            return
    place = _place(block, spans)
    words[place], words[place + 1] = tick, tick
    words[block + _SPANS] += 1
    words[block + _COUNT] += 1


def record_cut(words: "memoryview[int]", block: int, length: int) -> None:
    """Note in the block at word `block` that a text of so many bytes, or letters, was cut to its room."""
    spans = words[block + _SPANS]
    if length > spans >> _CUT_BITS:
        words[block + _SPANS] = (spans & _COUNTED) | min(length, _LONGEST) << _CUT_BITS


def read_failures(block: Sequence[int]) -> Failures:
    """What was counted in the words of a block; of more than 15 stretches some in the middle are missing."""
    count, spans = block[_COUNT], block[_SPANS] & _COUNTED
    if not count:
        return NO_FAILURES
    kept = [*range(min(spans, _OLDEST)), *range(max(_OLDEST, spans - _NEWEST), spans)]
    places = [_place(0, number) for number in kept]
    return Failures(count, tuple((block[place], block[place + 1]) for place in places))


def read_cut(block: Sequence[int]) -> int:
    """How long the longest text was that was cut to its room, in bytes, or letters of texts in arrays; 0 for none."""
    return block[_SPANS] >> _CUT_BITS


def _place(block: int, number: int) -> int:
    return block + _FIRST + 2 * (number if number < _OLDEST else _OLDEST + (number - _OLDEST) % _NEWEST)
