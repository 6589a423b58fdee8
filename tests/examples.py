"""How many examples the properties are tried on: HYPOTHESIS_PROFILE=long tries many times as many.

The fast tier by itself (`-m "not slow"`) tries a quarter: it is for who waits for it. What lands is tried on all.
"""

import os

from hypothesis import HealthCheck, settings

_TIMES = {"fast": 0.25, "ci": 1.0, "long": 25.0}
_chosen = "ci"


def examples(count: int) -> int:
    """Return how many examples to try of a property that gets `count` of them in every run of all tests."""
    return max(1, round(count * _TIMES[_chosen]))


def load_profile(*, fast: bool) -> None:
    """Choose how many; give an example no deadline and no time to be made in: a busy machine keeps none."""
    global _chosen  # noqa: PLW0603
    _chosen = os.environ.get("HYPOTHESIS_PROFILE", "fast" if fast else "ci")
    settings.register_profile(
        _chosen,
        deadline=None,
        print_blob=True,
        suppress_health_check=[HealthCheck.too_slow],
        max_examples=examples(100),
    )
    settings.load_profile(_chosen)
