"""The parameters of a logger, from its client: a mapping of names to values that asks the robot."""

import secrets
from collections.abc import Iterator, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, NoReturn

from silo.core.arguments import real
from silo.core.parameters import ParameterInfo, ParameterValue
from silo.errors import ElementError
from silo.parameters.requests import ParameterRequests, ParametersSet

if TYPE_CHECKING:
    from silo.core.parameters import ParameterScalar

LONGEST_REVERT_S = 24 * 3600.0


class ClientParameters(MutableMapping[str, ParameterValue]):
    """`client.parameters["kp"]` asks, `client.parameters["kp"] = 50.0` sets and waits until it holds."""

    def __init__(self, client: ParameterRequests) -> None:
        """Ask by this client, anew each time."""
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
        known = self.described()
        found = [one for one in known if one.name == name] or [
            one for one in known if one.name.endswith(f"/{name.strip('/')}")
        ]
        if len(found) != 1:
            names = ", ".join(one.name for one in (found or known)[:5]) or "it has none"
            raise ElementError(f"{'several parameters' if found else 'no parameter'} '{name}': {names}")
        return found[0]

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
        return self._client._set_parameters(plain, secrets.token_hex(8), after_s)

    def confirm(self, change: ParametersSet) -> str:
        """Keep what would be taken back.

        Args:
            change: what `set` returned.

        Returns:
            What was done, in words.
        """
        return self._client._confirm_parameters(change.name)

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
