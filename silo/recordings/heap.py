"""The helper's own memory: what it frees goes back to the system, so that a busy hour doesn't make it large for good.

glibc keeps freed memory in one arena per thread, and Zenoh's threads and ours are 20: in a soak of 1,000 elements the
helper went from 43 to 70 MB within 40 s. It also answers each large block that is freed by keeping larger ones in the
heap. With two arenas and fixed thresholds the same use ended at 32 MB. Python's own allocator is switched off where the
helper is spawned (`PYTHONMALLOC`): ten saves of 10,000 elements left 16 MB in its pools, and leave 1 MB in glibc's.
"""

import ctypes
import gc

_libc = ctypes.CDLL(None)  # made once: each one is a cycle of 18 objects

# the parameters of mallopt(3); what the user sets in the environment (MALLOC_ARENA_MAX ...) is overridden
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
ARENAS = 2
THRESHOLD_BYTES = 128 * 1024


def limit_heap() -> bool:
    """Bound what freed memory may stay; to be called before the first thread begins. False where there is no glibc."""
    mallopt = getattr(_libc, "mallopt", None)
    if mallopt is None:
        return False
    done = (
        mallopt(_ARENA_MAX, ARENAS),
        mallopt(_TRIM_THRESHOLD, THRESHOLD_BYTES),
        mallopt(_MMAP_THRESHOLD, THRESHOLD_BYTES),
    )
    return all(done)


def trim_heap() -> None:
    """Give freed memory back to the system: 4 MB after a save of 10,000 elements, most of it Python's free lists.

    Only glibc needs, and has, the call for its part.
    """
    gc.collect()
    trim = getattr(_libc, "malloc_trim", None)
    if trim is not None:
        trim(0)
