"""The parameters of a logger, from its client: a mapping of names to values that asks the robot."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, NoReturn

from silo.core.arguments import real, word
from silo.core.tuning.excitation import LEASE_S, LONGEST_S, element_of, usual_ramp_s
from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterValue, Wave, only_meant
from silo.errors import ElementError, SiloError
from silo.parameters.requests import LONGEST_REVERT_S, ExcitationState, ParameterRequests, ParametersSet

if TYPE_CHECKING:
    from silo.core.tuning.parameters import ParameterScalar

KEEP_S = LEASE_S / 5  # between two signs of life
STOP_S = 10.0  # for its way back, which takes as long as its program's `rate=` wants

Wait = Callable[[ExcitationState, float], bool | None]


class ClientParameters(MutableMapping[str, ParameterValue]):
    """`client.parameters["kp"]` asks, `client.parameters["kp"] = 50.0` sets and waits until it holds."""

    def __init__(self, client: ParameterRequests) -> None:
        self._client = client

    def described(self) -> list[ParameterInfo]:
        """Return what each is: its range, default, present value.

        Returns:
            In the order in which the program declared them.
        """
        return self._client._list_parameters().parameters

    def info(self, name: str) -> ParameterInfo:
        """Return what one is.

        Args:
            name: with or without prefix and group, where it is clear.

        Raises:
            ElementError: there is none, or several.
        """
        known = {one.name: one for one in self.described()}
        return known[only_meant(name, known)]

    def set(self, values: Mapping[str, Any], *, revert_after: float = 0.0) -> ParametersSet:
        """Set some, all or none, at the end of a tick.

        Args:
            values: by name.
            revert_after: s, after which they are taken back unless `confirm` is called; 0: never.

        Returns:
            From which tick on they hold, or that they wait for one; its name.

        Raises:
            RefusedError: a value doesn't fit, or may not be set by this client, or too many wait; nothing was changed.
        """
        after_s = real("revert_after", revert_after, 0, LONGEST_REVERT_S, "s")
        plain = {name: _plain(value) for name, value in values.items()}
        return self._client._set_parameters(plain, os.urandom(8).hex(), after_s)

    def confirm(self, change: ParametersSet) -> str:
        """Keep what would be taken back.

        Args:
            change: what `set` returned.

        Returns:
            What was done, in words.
        """
        return self._client._confirm_parameters(change.name)

    def excite(
        self,
        name: str,
        wave: Wave | str,
        *,
        amplitude: float,
        duration: float,
        low_hz: float = 0.0,
        high_hz: float = 0.0,
        ramp: float | None = None,
        wait: Callable[[ExcitationState, float], bool | None] | None = None,
    ) -> ExcitationState:
        """Move a parameter, or an input, around its value; returns when it is back there.

            robot.parameters.excite("tau_offset", "chirp", amplitude=2.0, duration=20, low_hz=0.1, high_hz=20)

        It ends before its time when this is interrupted or its process dies, a limit fires, somebody sets the
        parameter or stops the logger, the program closes it, or the loop stands still.

        Args:
            name: of the parameter; `tau_offset[3]` is a value of an array.
            wave: a chirp or a multisine from `low_hz` to `high_hz`, a PRBS that decides `high_hz` times a second, or a
                step.
            amplitude: to both sides; of a step in its direction.
            duration: s.
            low_hz: from where it goes, Hz.
            high_hz: to where.
            ramp: s, in which it rises and falls; None: up to 1 s, of a step none.
            wait: called with how far it is, and to wait so many seconds; True ends it.

        Returns:
            Why it ended, in which rows it was.

        Raises:
            RefusedError: it would leave the bounds, or may not be begun by this client; nothing was changed.
            ConnectionLostError: nobody answers; the robot program ends it within 2 s.
        """
        name, index = element_of(name)
        kind = word("wave", wave, Wave)
        duration_s = real("duration", duration, 0, LONGEST_S, "s", include_low=False)
        ramp_s = usual_ramp_s(kind, duration_s) if ramp is None else real("ramp", ramp, 0, LONGEST_S, "s")
        what = Excitation(
            name,
            kind,
            real("amplitude", amplitude, -1e300, 1e300, ""),
            duration_s,
            real("low_hz", low_hz, 0, 1e9, "Hz"),
            real("high_hz", high_hz, 0, 1e9, "Hz"),
            ramp_s,
            index,
        )
        return excite(self._client, what, wait)

    def __getitem__(self, name: str) -> ParameterValue:
        return self.info(name).value

    def __setitem__(self, name: str, value: Any) -> None:
        self.set({name: value})

    def __delitem__(self, name: str) -> NoReturn:
        raise ElementError(f"parameter '{name}' is the program's: set it, or set its default")

    def __iter__(self) -> Iterator[str]:
        return iter([one.name for one in self.described()])

    def __len__(self) -> int:
        return len(self.described())


def _plain(value: Any) -> ParameterValue:
    """A value as it travels: arrays flat, members of enumerations by their names."""
    if hasattr(value, "tolist"):
        value = value.ravel().tolist() if getattr(value, "shape", ()) else value.tolist()
    if isinstance(value, list | tuple):
        items: list[ParameterScalar] = [one for item in value for one in _items(item)]
        return tuple(items)
    named: ParameterValue = value.name if hasattr(value, "name") and hasattr(type(value), "__members__") else value
    return named


def _items(value: Any) -> "tuple[ParameterScalar, ...]":
    plain = _plain(value)
    return plain if isinstance(plain, tuple) else (plain,)


def excite(client: ParameterRequests, what: Excitation, wait: Wait | None) -> ExcitationState:
    """Have a parameter excited, and return how it ended; whatever interrupts this ends it."""
    name = os.urandom(8).hex()
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
