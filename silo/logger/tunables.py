"""Declaring the parameters of a logger: each is an element too, sampled slowly; its changes are recorded exactly."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from msgspec.structs import replace

from silo.core.arguments import line, text
from silo.core.calls import told_class
from silo.core.elements import Action, LoggerOptions, join_name
from silo.core.tuning.parameters import ParameterInfo, ParameterKind, Writable
from silo.errors import ElementError
from silo.logger.arguments.options import string_room
from silo.logger.life_cycle import LifeCycle
from silo.parameters.parameter import Parameter
from silo.parameters.parameters import Parameters, kind_of_default

SAMPLES_HZ = 10.0  # of their elements: at each tick 1,000 of them would cost 0.9 us, 8 MB/s at 1 kHz
DEFAULT_STRING_BYTES = 64


@told_class("log")
class Tunables:
    """What a logger offers to be tuned."""

    def __init__(
        self, options: LoggerOptions, add: Callable[..., None], life: LifeCycle, parameters: Parameters
    ) -> None:
        self._options, self._add, self._life, self._parameters = options, add, life, parameters

    def parameter(
        self,
        name: str,
        default: Any,
        *,
        min: float | None = None,  # noqa: A002  # as everybody calls it
        max: float | None = None,  # noqa: A002
        step: float | None = None,
        unit: str = "-",
        group: str = "",
        choices: Any = None,
        rate: float | None = None,
        check: Callable[..., object] | None = None,
        writable: bool | Literal["anywhere"] = True,
        locked: bool = False,
        string_bytes: int = DEFAULT_STRING_BYTES,
        description: str = "",
    ) -> Parameter:
        """Offer a value to be tuned while the program runs: `kp = log.parameter("kp", 40.0, min=0, max=200)`.

        What others set lands at the end of a `collect()`, whole, with all that was set together. It is logged with its
        changes, who made them and the tick from which they held.

        Args:
            name: its name after prefix and group, or whole with the prefix.
            default: a float, an int, True or False, a member of an enumeration, a text, or an array of such.
            min: the least that it may be.
            max: the most that it may be.
            step: it goes from `min`, or 0, in such steps.
            unit: `"Nm/rad"`, `"-"` for none.
            group: the namespace between prefix and name.
            choices: an enumeration, or words, of which it is one.
            rate: how fast it moves to what others set, in units per second; all that is set together arrives at once.
            check: called with a new value, or with it and the values of its group by name; what it raises, or a text
                that it returns, is why the value is refused. In the thread of whoever sets it: `silo-link` for clients.
            writable: True: by clients on this computer; `"anywhere"`: by those on others as well; False: by nobody but
                the program.
            locked: closed to clients while the program holds `log.parameters.lock()`.
            string_bytes: room for a text.
            description: a line about it.

        Returns:
            The parameter: `kp.value`, `kp[...]`, and `kp * error` as with an array.

        Raises:
            ElementError: the name is taken, the default doesn't fit, or bounds make no sense; nothing was added.
        """
        return self._declare(
            ParameterInfo(
                name, ParameterKind.FLOAT, default, (), min, max, step, unit, (), rate, _writable(name, writable),
                locked, string_bytes, description,
            ),
            group, check, choices, _divider(self._options.frequency_hz),
        )  # fmt: skip

    def input(
        self,
        name: str,
        min: float,  # noqa: A002  # as everybody calls it
        max: float,  # noqa: A002
        shape: int | tuple[int, ...] = (),
        *,
        unit: str = "-",
        group: str = "",
        rate: float | None = None,
        check: Callable[..., object] | None = None,
        writable: bool | Literal["anywhere"] = True,
        locked: bool = False,
        description: str = "",
    ) -> Parameter:
        """Offer an input for excitations: `tau_offset = log.input("tau_offset", -5, 5, unit="Nm")`.

        It is 0 but while somebody excites it (`silo excite`), and logged at each tick: the program adds it to what it
        commands, so that a transfer function can be measured.

        Args:
            name: its name after prefix and group, or whole with the prefix.
            min: the least that it may be, 0 or less.
            max: the most that it may be, 0 or more.
            shape: of an array of them; one of its values is excited at a time.
            unit: `"Nm"`, `"-"` for none.
            group: the namespace between prefix and name.
            rate: how fast it may move, in units per second.
            check: called with both ends that it will come to, as that of a parameter.
            writable: who may excite it, as of a parameter.
            locked: closed to clients while the program holds `log.parameters.lock()`.
            description: a line about it.

        Returns:
            The input, which reads like an array, as a parameter does.

        Raises:
            ElementError: the name is taken, or bounds make no sense; nothing was added.
        """
        zero = np.zeros(shape).tolist()
        return self._declare(
            ParameterInfo(
                name, ParameterKind.FLOAT, zero, (), min, max, None, unit, (), rate, _writable(name, writable),
                locked, 0, description, input=True,
            ),
            group, check, None, 1,
        )  # fmt: skip

    def _declare(
        self, given: ParameterInfo, group: str, check: Callable[..., object] | None, choices: Any, divider: int
    ) -> Parameter:
        """Add a parameter of which these facts are known, and its element."""
        self._life.check_open()
        how = f"log.{'input' if given.input else 'parameter'}"
        name, default = text("the parameter's name", given.name, f'{how}("kp", ...)'), given.default
        group = text("group", group, 'group="legs"')
        if not name:
            raise ElementError(f'a parameter needs a name: {how}("kp", ...)')
        full = join_name(self._options.prefix, group, name)
        kind, shape, words = kind_of_default(full, default, choices)
        info = replace(
            given,
            name=full,
            kind=kind,
            default=default if not hasattr(default, "tolist") else default.tolist(),
            shape=shape,
            unit=line("unit", given.unit, 'unit="Nm/rad"'),
            choices=words,
            string_bytes=string_room(given.string_bytes) or DEFAULT_STRING_BYTES if kind is ParameterKind.STRING else 0,
            description=text("description", given.description, 'description="..."'),
        )
        with self._life.lock:
            if full in self._parameters.names:
                raise ElementError(f"parameter '{full}' is there already; give this one another name or group")
            made = self._parameters.declare(
                info, check, type(default) if hasattr(type(default), "__members__") else choices
            )
            self._add(
                made.array,
                name,
                group,
                info.unit,
                divider,
                Action.SAVE_AND_PUBLISH,  # `silo.topic` has them; the buffers that are saved carry it
                labels=dict(enumerate(words)) if words else None,
                description=info.description,
            )
        return made


def _divider(frequency_hz: float) -> int:
    return max(1, round(frequency_hz / SAMPLES_HZ))


def _writable(name: str, given: object) -> Writable:
    words = {True: Writable.HERE, False: Writable.NO, "anywhere": Writable.ANYWHERE}
    if not isinstance(given, bool | str) or given not in words:
        raise ElementError(f"parameter '{name}': writable is True, False or 'anywhere', got {given!r}")
    return words[given]
