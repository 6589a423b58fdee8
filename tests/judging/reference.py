"""Expressions judged row by row in plain Python: slow, and without any thought of batches."""

import math
from dataclasses import dataclass

from silo.expressions.binding import OFF, BoundExpression, BoundSignal, Computed, Constant, Remembered, columns_of

COMPARED = {
    "<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b, "!=": lambda a, b: a != b,
}  # fmt: skip


@dataclass
class Stream:
    """All samples of a source: `rows` has (tick, time_ns, {key: value})."""

    divider: int
    rows: list

    def last(self, tick):
        """The place of the sample that holds at a tick, None before the first."""
        found = [place for place, row in enumerate(self.rows) if row[0] <= tick]
        return found[-1] if found else None

    def missing(self, tick):
        place = self.last(tick)
        return place is None or tick - self.rows[place][0] >= self.divider


class Reference:
    def __init__(self, bound: BoundExpression, streams: dict[int, Stream], *, whole: bool = False) -> None:
        """`whole`: constants are integers of Python, where they are some, as the samples."""
        self.bound, self.streams, self.whole = bound, streams, whole
        self.memory = {}

    def judged(self):
        """(tick, value) at each tick; values are floats, truths True, False or None, vectors lists of them."""
        return [(tick, self.value(self.bound.root, tick)) for tick in self.ticks(self.bound.sources)]

    def ticks(self, sources):
        return sorted({row[0] for source in sources for row in self.streams[source].rows})

    def missing(self, sources, tick):
        return any(source == OFF or self.streams[source].missing(tick) for source in sources)

    def value(self, part, tick):
        if isinstance(part, Constant):
            if not self.whole or not part.value.is_integer():
                return part.value
            return int(part.value) if part.whole is None else part.whole
        if isinstance(part, BoundSignal):
            found = [self.sample(column, tick) for column in part.columns]
            return found if part.vector else found[0]
        if isinstance(part, Remembered):
            return self.recalled(part, tick)
        if part.operator == "isnan":
            blind = self.missing({column.source for column in columns_of(part)}, tick)
            return each(lambda x: None if blind else math.isnan(x), number(self.value(part.parts[0], tick)))
        return operate(part, [self.value(one, tick) for one in part.parts])

    def sample(self, column, tick):
        if self.missing([column.source], tick):
            return math.nan
        stream = self.streams[column.source]
        return stream.rows[stream.last(tick)][2][column.element, column.entry]

    def recalled(self, part, tick):
        if part not in self.memory:
            self.memory[part] = self.remembered(part)
        results, shape = self.memory[part]
        earlier = [result for at, result in results if at <= tick]
        if not earlier or self.missing(part.sources, tick):
            return each(lambda _: math.nan, shape)
        return earlier[-1]

    def remembered(self, part):
        if OFF in part.sources:
            return [], number(self.value(part.part, 0))
        ticks = self.ticks(part.sources)
        times = [self.time(part.sources, tick) for tick in ticks]
        values = [number(self.value(part.part, tick)) for tick in ticks]
        results, begin = [], 0
        for at, tick in enumerate(ticks):
            broken = at > 0 and self.broken(part.sources, ticks[at - 1], tick)
            if broken or (at > 0 and times[at] < times[at - 1]):
                begin = at
            if part.window_ns:
                inside = [place for place in range(begin, at + 1) if times[place] > times[at] - part.window_ns]
                made = window(part.function, [values[place] for place in inside])
            elif at == 0 or broken:
                made = each(lambda _: math.nan, values[at])
            elif part.function == "prev":
                made = values[at - 1]
            else:
                made = both(lambda a, b: a - b, values[at], values[at - 1])
                if part.function == "rate":
                    seconds = (times[at] - times[at - 1]) * 1e-9
                    made = each(lambda x, s=seconds: x / s if s > 0 else math.nan, made)
            if self.missing(part.sources, tick):
                made = each(lambda _: math.nan, made)
            results.append((tick, made))
        shape = number(self.value(part.part, 0))
        return results, shape

    def time(self, sources, tick):
        return next(row[1] for source in sources for row in self.streams[source].rows if row[0] == tick)

    def broken(self, sources, before, tick):
        for source in sources:
            stream = self.streams[source]
            old, new = stream.last(before), stream.last(tick)
            if old is not None and stream.rows[new][0] - stream.rows[old][0] > stream.divider:
                return True
        return False


def each(function, value):
    return [function(one) for one in value] if isinstance(value, list) else function(value)


def both(function, one, other):
    if isinstance(one, list) or isinstance(other, list):
        count = len(one) if isinstance(one, list) else len(other)
        one = one if isinstance(one, list) else [one] * count
        other = other if isinstance(other, list) else [other] * count
        return [function(a, b) for a, b in zip(one, other, strict=True)]
    return function(one, other)


def number(value):
    return each(lambda x: math.nan if x is None else x if type(x) is int else float(x), value)


def truth(value):
    def one(x):
        if x is None or isinstance(x, bool):
            return x
        return None if math.isnan(x) else x != 0

    return each(one, value)


def window(function, values):
    if isinstance(values[0], list):
        return [window(function, list(column)) for column in zip(*values, strict=True)]
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return math.nan
    if function in ("min", "max"):
        return min(known) if function == "min" else max(known)
    if any(map(math.isinf, known)):
        return math.nan if function == "std" or len({x for x in known if math.isinf(x)}) > 1 else sum(known)
    mean = math.fsum(known) / len(known)
    return mean if function == "mean" else math.sqrt(math.fsum((x - mean) ** 2 for x in known) / len(known))


def conjunction(values):
    return False if False in values else None if None in values else True


def negated(value):
    return None if value is None else not value


def chain(function, values):
    made = values[0]
    for value in values[1:]:
        made = both(function, made, value)
    return made


def gathered(values):
    return [one for value in values for one in (value if isinstance(value, list) else [value])]


def arithmetic(operator, a, b):
    if math.isnan(a) or math.isnan(b):
        return math.nan
    if operator == "/":
        return a / b if b else math.nan if a == 0 else math.copysign(math.inf, a) * math.copysign(1, b)
    if operator == "%":
        return a % b if b else math.nan
    if operator in ("min", "max"):
        return min(a, b) if operator == "min" else max(a, b)
    if operator == "hypot":
        return math.hypot(a, b)
    return {"+": a + b, "-": a - b, "*": a * b}[operator]


def operate(part: Computed, values):
    operator = part.operator
    if operator in ("and", "or"):
        flip = negated if operator == "or" else (lambda x: x)
        return chain(lambda a, b: flip(conjunction([flip(a), flip(b)])), [truth(value) for value in values])
    if operator == "not":
        return each(negated, truth(values[0]))
    if operator in ("any", "all"):
        found = gathered([truth(value) for value in values])
        return conjunction(found) if operator == "all" else negated(conjunction([negated(one) for one in found]))
    if operator in COMPARED:

        def compare(a, b):
            return None if math.isnan(a) or math.isnan(b) else COMPARED[operator](a, b)

        return both(compare, number(values[0]), number(values[1]))
    numbers = [number(value) for value in values]
    if operator in ("neg", "abs"):
        return each(abs if operator == "abs" else (lambda x: -x), numbers[0])
    if operator == "sum_of":
        return chain(lambda a, b: a + b, gathered(numbers))
    if operator == "norm_of":
        return math.sqrt(sum(x * x for x in gathered(numbers)))
    if operator in ("min_of", "max_of"):
        return chain(lambda a, b: arithmetic(operator[:3], a, b), gathered(numbers))
    return chain(lambda a, b: arithmetic(operator, a, b), numbers)
