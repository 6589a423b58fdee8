"""What is shown less often, or with fewer digits, where the link is thin; keys never wait for it.

Plain arithmetic: once per live frame the app says whether the terminal lags. Back in steps after 5 s without lag.
"""

from collections import deque

import msgspec

from silo_tui.model.words import text

LAG_S = 0.15  # what a key may wait behind live values
FAT_BYTES_PER_S = 250_000  # what carries that much is not thin: late frames are those of a busy computer
HERE_S = 0.005  # a terminal that ever answered so soon, without SSH, is on this computer: what is late is no link
START_S = 5.0  # for so long all is drawn for the first time, and loaded: what is late then is this computer
JUDGED_S = 1.0
GOOD_S = 5.0
LONGEST_GOOD_S = 60.0
LATE_SHARE = 0.34
BUSY_S = 2.0
BUSY_SHARE = 0.1  # of that time; on two processors with a load of 10 to 12 silo-tui waited for 13 to 49 % of it


class Pace(msgspec.Struct, frozen=True):
    """How often values, trends and statistics are painted, and how exactly."""

    value_share: float = 1.0  # of the wished rate
    trend_s: float = 1.0
    digits_fewer: int = 0
    statistics_s: float = 1.0


# in this order less is shown: trends, last digits, statistics, values
STEPS = (
    Pace(),
    Pace(trend_s=2.0),
    Pace(trend_s=8.0),
    Pace(trend_s=8.0, digits_fewer=1),
    Pace(trend_s=8.0, digits_fewer=2),
    Pace(trend_s=8.0, digits_fewer=2, statistics_s=8.0),
    Pace(0.5, 8.0, 2, 8.0),
    Pace(0.25, 8.0, 2, 8.0),
    Pace(0.1, 8.0, 2, 8.0),
)
SLOWEST_HZ = 0.5
RATE_S = 3.0  # over which the rate of paints is measured
BELOW = 0.8  # of the wished rate: less is told; timers are not that exact
WHOLE = 0.95  # of the wished rate: nothing is missed
TOLD_S = 10.0  # so long it goes on to be told: words in the head that come and go with each second move the others


class Painted:
    """How often values are painted, by the clock: what the terminal and this computer really take."""

    def __init__(self) -> None:
        self._asked_s: deque[tuple[float, bool]] = deque()  # when it was asked whether to paint, and what came of it
        self._wished_hz = self._hz = 0.0
        self._below_s = float("-inf")

    def note(self, wished_hz: float, *, painted: bool, now_s: float) -> None:
        """Take whether values were painted when it was their turn."""
        if wished_hz != self._wished_hz:
            self._asked_s.clear()
            self._wished_hz, self._below_s = wished_hz, float("-inf")
        self._asked_s.append((now_s, painted))
        while self._asked_s[0][0] < now_s - RATE_S - 1 / wished_hz:
            self._asked_s.popleft()
        span_s = now_s - self._asked_s[0][0]
        self._hz = sum(painted for _, painted in list(self._asked_s)[1:]) / span_s if span_s else 0.0
        if span_s >= RATE_S - 1 / wished_hz and self._hz < BELOW * wished_hz:
            self._below_s = now_s

    @property
    def words(self) -> str:
        """`1.2 of 5 Hz` where that is less than wished, or was too little a moment ago; empty until enough was seen."""
        is_whole = self._hz >= WHOLE * self._wished_hz
        if not self._asked_s or is_whole or self._asked_s[-1][0] > self._below_s + TOLD_S:
            return ""
        return f"{self._hz:.1f} of {text.short(self._wished_hz, 2)} Hz"  # as wide as before: it stands in a line


class Thinness:
    """How thin the link is: the step that holds, from 0 (all is shown)."""

    def __init__(self) -> None:
        self.step = 0
        self._seen: deque[tuple[float, bool]] = deque()
        self._stepped_s = 0.0
        self._good_since_s = 0.0
        self._good_s = GOOD_S  # longer after a step back that went wrong
        self._eased_s = float("-inf")

    @property
    def pace(self) -> Pace:
        """What holds now."""
        return STEPS[self.step]

    def value_hz(self, wished_hz: float) -> float:
        """Return how often values are painted now."""
        return min(wished_hz, max(SLOWEST_HZ, wished_hz * self.pace.value_share))

    def words(self, wished_hz: float) -> str:
        """Return what is left out now; empty where all is shown."""
        if not self.step:
            return ""
        pace, value_hz = self.pace, self.value_hz(wished_hz)
        parts = [f"values {text.short(value_hz, 2)} of {text.short(wished_hz, 2)} Hz"] if value_hz < wished_hz else []
        what = "trends and statistics" if pace.statistics_s > 1.0 else "trends"
        parts.append(f"{what} every {pace.trend_s:.0f} s")
        if pace.digits_fewer:
            parts.append(f"{pace.digits_fewer} digit{'s' * (pace.digits_fewer > 1)} fewer")
        return f"thin link, or a slow terminal: {', '.join(parts)}; keys go first"

    def note(self, *, late: bool, now_s: float) -> None:
        """Take whether the terminal lags."""
        if late or not self._seen:
            self._good_since_s = now_s
        self._seen.append((now_s, late))
        while self._seen[0][0] < now_s - 2 * JUDGED_S:
            self._seen.popleft()
        share = sum(each for _, each in self._seen) / len(self._seen)
        if late and share > LATE_SHARE and now_s - self._stepped_s >= JUDGED_S and self.step < len(STEPS) - 1:
            if now_s - self._eased_s < 2 * GOOD_S:
                self._good_s = min(LONGEST_GOOD_S, 2 * self._good_s)
            # where nothing came in time there is far too much
            self.step = min(len(STEPS) - 1, self.step + (2 if share > 0.9 else 1))
            self._stepped_s = now_s
        elif self.step and now_s - max(self._good_since_s, self._stepped_s) >= self._good_s:
            self.step -= 1
            self._stepped_s = self._eased_s = now_s
            if not self.step:
                self._good_s = GOOD_S


class Busyness:
    """How long this program waits for a processor: then answers of the terminal are late, whatever the link carries."""

    def __init__(self) -> None:
        self._waited: deque[tuple[float, float]] = deque()  # when, and for how long in all until then

    def note(self, waited_s: float, now_s: float) -> None:
        """Take for how long it has waited in all."""
        self._waited.append((now_s, waited_s))
        while self._waited[0][0] < now_s - BUSY_S:
            self._waited.popleft()

    @property
    def is_busy(self) -> bool:
        """Whether the processors have much else to do."""
        if not self._waited:
            return False
        (begin_s, before_s), (end_s, after_s) = self._waited[0], self._waited[-1]
        return after_s - before_s > BUSY_SHARE * (end_s - begin_s)


def head_words(thinness: Thinness, painted: Painted, link: list[str], room: int) -> str:
    """Return what the head says, in `room` cells: that the link is thin, the rate, what is known of the link. Where the
    link isn't why, the rate says all.
    """
    if not thinness.step:
        told = f"DRAWN {painted.words}" * bool(painted.words)
        return told if len(told) <= room else ""
    parts = list(filter(None, ["THIN", painted.words, *link]))
    while len(parts) > 1 and len(" ".join(parts)) > room:
        parts.pop()  # a number that is cut would be another one
    return " ".join(parts)
