"""What ends a test that hangs: a thread that watches all of them in turn."""

from types import SimpleNamespace

from tests.waiting import wait_until
from tests.watchdog import Watchdog

NEVER, AT_ONCE = SimpleNamespace(timeout=1e6), SimpleNamespace(timeout=0.0)


def test_what_takes_too_long_is_told_of_once_and_what_ended_in_time_never():
    expired = []
    watchdog = Watchdog(lambda item, settings: expired.append((item, settings)), looks_every_s=0.001)
    watchdog.watch("in time", NEVER)
    watchdog.watch("too long", AT_ONCE)
    wait_until(lambda: expired)
    watchdog.leave()
    watchdog.watch("too long again", AT_ONCE)
    wait_until(lambda: len(expired) > 1)
    assert expired == [("too long", AT_ONCE), ("too long again", AT_ONCE)]
