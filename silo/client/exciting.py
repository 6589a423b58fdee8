"""An excitation, kept going by its client: what it says to the robot program meanwhile."""

import contextlib
import secrets
import time
from collections.abc import Callable

from silo.core.tuning.excitation import LEASE_S
from silo.core.tuning.parameters import Excitation
from silo.errors import SiloError
from silo.parameters.requests import ExcitationState, ParameterRequests

KEEP_S = LEASE_S / 5  # between two signs of life
STOP_S = 10.0  # for its way back, which takes as long as its program's `rate=` wants

Wait = Callable[[ExcitationState, float], bool | None]


def excite(client: ParameterRequests, what: Excitation, wait: Wait | None) -> ExcitationState:
    """Have a parameter excited, and return how it ended; whatever interrupts this ends it."""
    name = secrets.token_hex(8)
    wait = wait or _sleep
    try:
        state = client._excite(what, name)
        while not state.ended:
            if wait(state, KEEP_S):
                return _stopped(client, name)
            state = client._keep_excitation(name)
    except BaseException:
        with contextlib.suppress(SiloError):  # else it ends because nobody says that it should go on
            client._stop_excitation(name)
        raise
    return state


def _stopped(client: ParameterRequests, name: str) -> ExcitationState:
    """End it, and return when the value is back."""
    client._stop_excitation(name)
    until_s = time.monotonic() + STOP_S
    while True:
        state = client._keep_excitation(name)
        if state.ended or time.monotonic() > until_s:
            return state
        time.sleep(KEEP_S / 4)


def _sleep(_: ExcitationState, seconds: float) -> None:
    time.sleep(seconds)
