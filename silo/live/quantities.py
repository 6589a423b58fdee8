"""What a survey of a logger's elements tells: the names of its quantities and the rules of its signs.

The helper process measures, `silo_tui` and other clients show; both read the words here.
"""

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo.core.elements import SLOW_SHARE

# per element; of several entries it is their norm
QUANTITIES = (
    "value", "min", "max", "mean", "std", "noise", "count", "rate", "share", "jitter", "changed", "change_seen", "fill",
    "held", "signs", "bad", "least", "most",
)  # fmt: skip
"""`value` newest; `min` to `count` of all finite samples since the reset, `noise` of their second differences: the root
mean square over sqrt(6), the standard deviation of white noise on whatever moves slowly; `rate` in Hz and `share` of
the nominal one; `jitter` the standard deviation of the time between samples in s; `changed` seconds since the value
last changed, also in an earlier run, or, without `change_seen` (1 or 0), since it is known: that change is longer ago;
`fill` 0 ... 1 and `held` samples of the buffer; `signs` bits; `bad` how many samples since the reset were nan or inf;
`least` and `most` the smallest and the largest of any of its entries, where `min` and `max` are of its norm."""

NOT_FINITE, FROZEN, SLOW, LOST = 1, 2, 4, 8
NOT_FINITE_S = 10.0  # for so long after a nan or inf its sign stays: nobody sees that of one sample in ten
FROZEN_PERIODS = 100
FROZEN_S = 1.0


def signs_of(
    finite: NDArray[np.bool_], changed_s: Floats, pace_s: Floats, may_freeze: NDArray[np.bool_], share: Floats,
    lost: NDArray[np.int64],
) -> NDArray[np.int64]:  # fmt: skip
    """Return the bits of what is the matter with each element.

    `pace_s` is the mean time between changes of a value, up to its last one. It is frozen when it didn't change for 100
    of these and a second: what never changed, or as seldom as a peak, isn't. `may_freeze` tells numbers from switches
    and states, which stand still rightly; where a time or a share isn't known (NaN) its sign is left out.
    """
    frozen = may_freeze & (changed_s > np.maximum(FROZEN_PERIODS * pace_s, FROZEN_S))
    return (
        np.where(~finite, NOT_FINITE, 0)
        | np.where(frozen, FROZEN, 0)
        | np.where(share < SLOW_SHARE, SLOW, 0)
        | np.where(lost > 0, LOST, 0)
    ).astype(np.int64)
