"""For how long this thread has waited for a processor, as the kernel counts it."""

from pathlib import Path

_COUNTS = Path("/proc/thread-self/schedstat")  # on a processor, waiting for one (both ns), how often


def waited_s() -> float:
    """Return how many seconds, since it was started; 0 where the kernel doesn't count."""
    try:
        return int(_COUNTS.read_text().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0
