"""One parameter, as the program has it: read like an array, set by assignment."""

import enum
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from silo.core.tuning.parameters import ParameterInfo, ParameterKind, decoded, value_text

Set = Callable[[ParameterInfo, object], None]

_NUMBERS = (ParameterKind.FLOAT, ParameterKind.INT, ParameterKind.BOOL)


class Parameter(NDArrayOperatorsMixin):
    """A value that is tuned while the program runs: `kp.value`, `kp[...]`, or in expressions: `kp * error`.

    It changes at the end of `collect()` and stands still from there to the next one, but for what the program sets
    itself: `kp.value = 50.0`, which is checked as any change, recorded, and holds from the next row on.
    """

    __slots__ = ("_item", "_set", "_words", "array", "choices", "info")
    __hash__ = object.__hash__

    def __init__(
        self, info: ParameterInfo, array: NDArray[Any], words: memoryview, set_value: Set, choices: Any = None
    ) -> None:
        """Show the value that stands in `words`; `array` is the same memory. `choices` is the enumeration, if any."""
        self.info, self.array, self._words, self._set, self.choices = info, array, words, set_value, choices
        self.array.setflags(write=False)
        self._item = array.item if info.kind in _NUMBERS and not info.shape else self._decoded

    def _decoded(self) -> Any:
        if self.info.shape and self.info.kind in _NUMBERS:
            return self.array.copy()
        value = decoded(self.info, self._words)
        if self.info.shape:
            return np.array(value).reshape(self.info.shape)
        return (
            self.choices[str(value)]
            if isinstance(self.choices, type) and issubclass(self.choices, enum.Enum)
            else value
        )

    @property
    def name(self) -> str:
        """Its full name, as that of its element."""
        return self.info.name

    @property
    def value(self) -> Any:
        """The present value: a number, a text, a member of its enumeration; of an array a copy."""
        return self._item()

    @value.setter
    def value(self, value: object) -> None:
        self._set(self.info, value)

    @property
    def default(self) -> Any:
        """What it was before anybody changed it."""
        return self.info.default

    def __getitem__(self, key: Any) -> Any:
        return self._shown()[key]

    def __setitem__(self, key: Any, value: Any) -> None:
        kept = np.result_type(self.array, np.asarray(value)) if self.info.kind in _NUMBERS else object
        whole: Any = self._shown().astype(kept)
        whole[key] = value
        self._set(self.info, whole.tolist())

    def _shown(self) -> NDArray[Any]:
        return self.array if self.info.kind is not ParameterKind.STRING else np.asarray(self._decoded())

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        shown = self._shown()
        return np.array(shown, dtype) if copy is not False else np.asarray(shown, dtype)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        taken = tuple(one._shown() if isinstance(one, Parameter) else one for one in inputs)
        if any(isinstance(one, Parameter) for one in kwargs.get("out", ())):
            raise TypeError(f"set {self.name.rpartition('/')[2]}.value, which is checked and recorded")
        return getattr(ufunc, method)(*taken, **kwargs)

    def __float__(self) -> float:
        return float(self.array)

    def __int__(self) -> int:
        return int(self.array)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __len__(self) -> int:
        return len(self._shown())

    def __format__(self, spec: str) -> str:
        return format(self.value, spec)

    def __repr__(self) -> str:
        return f"<Parameter {self.name} = {value_text(decoded(self.info, self._words), self.info.unit)}>"
