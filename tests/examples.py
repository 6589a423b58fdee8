"""How many examples the properties are tried on: HYPOTHESIS_PROFILE=long tries many times as many."""

import os

from hypothesis import HealthCheck, settings

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "ci")
_TIMES = {"ci": 1, "long": 25}


def examples(count: int) -> int:
    """Return how many examples to try of a property that gets `count` of them in every run."""
    return count * _TIMES[PROFILE]


def load_profile() -> None:
    """Give an example no deadline and no time to be made in: a busy machine keeps none."""
    for name in _TIMES:
        settings.register_profile(
            name,
            deadline=None,
            print_blob=True,
            suppress_health_check=[HealthCheck.too_slow],
            max_examples=examples(100),
        )
    settings.load_profile(PROFILE)
