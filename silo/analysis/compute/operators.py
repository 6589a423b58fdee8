"""`SignalOperators`: arithmetic, comparisons and logic of signals, and what makes NumPy take them for arrays."""

import operator
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute import numpy_functions
from silo.analysis.compute.arithmetic import combined, compared, wide
from silo.analysis.compute.samples import Samples
from silo.core.calls import told_class
from silo.errors import ElementError

Self = TypeVar("Self", bound="SignalOperators")
Operand: TypeAlias = Self | float | int | NDArray[Any]


@told_class("signal")
class SignalOperators(Samples):
    """Signals stand for their values where one calculates."""

    # ------------------------------------------------------------------------------------------------------ arithmetic

    def __add__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.add, "+")

    def __radd__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.add, "+", swapped=True)

    def __sub__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.sub, "-")

    def __rsub__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.sub, "-", swapped=True)

    def __mul__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.mul, "*")

    def __rmul__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.mul, "*", swapped=True)

    def __truediv__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.truediv, "/")

    def __rtruediv__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.truediv, "/", swapped=True)

    def __pow__(self: Self, exponent: float) -> Self:
        return combined(self, exponent, operator.pow, "**")

    def __rpow__(self: Self, base: float) -> Self:
        return combined(self, base, operator.pow, "**", swapped=True)

    def __neg__(self: Self) -> Self:
        return replace(self, name=f"-{self.name}", values=-wide(self), labels={})

    def __abs__(self: Self) -> Self:
        return replace(self, name=f"abs({self.name})", values=np.abs(wide(self)), labels={})

    def __mod__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.mod, "%")

    def __floordiv__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.floordiv, "//")

    def __rmod__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.mod, "%", swapped=True)

    def __rfloordiv__(self: Self, other: Operand[Self]) -> Self:
        return combined(self, other, operator.floordiv, "//", swapped=True)

    # ----------------------------------------------------------------------------------------------- comparisons, logic

    def __lt__(self: Self, other: Operand[Self]) -> Self:
        return compared(self, other, operator.lt, "<")

    def __le__(self: Self, other: Operand[Self]) -> Self:
        return compared(self, other, operator.le, "<=")

    def __gt__(self: Self, other: Operand[Self]) -> Self:
        return compared(self, other, operator.gt, ">")

    def __ge__(self: Self, other: Operand[Self]) -> Self:
        return compared(self, other, operator.ge, ">=")

    def __eq__(self: Self, other: object) -> Self:  # type: ignore[override]  # as arrays do
        return NotImplemented if other is None else compared(self, other, operator.eq, "==")  # type: ignore[arg-type]

    def __ne__(self: Self, other: object) -> Self:  # type: ignore[override]
        return NotImplemented if other is None else compared(self, other, operator.ne, "!=")  # type: ignore[arg-type]

    __hash__ = object.__hash__

    def __and__(self: Self, other: Operand[Self]) -> Self:
        return numpy_functions.logical(self, other, np.bitwise_and, "&")

    def __or__(self: Self, other: Operand[Self]) -> Self:
        return numpy_functions.logical(self, other, np.bitwise_or, "|")

    def __xor__(self: Self, other: Operand[Self]) -> Self:
        return numpy_functions.logical(self, other, np.bitwise_xor, "^")

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __invert__(self: Self) -> Self:
        return numpy_functions.ufunc_of(self, np.invert, "__call__", (self,), {})  # type: ignore[no-any-return]

    def __bool__(self) -> bool:
        if self.values.size == 1:
            return bool(self.values.reshape(-1)[0])
        raise ElementError(
            f"'{self.name}' has {len(self)} samples, so it is neither true nor false: write .any(), .all() or len(...)"
        )

    def __float__(self) -> float:
        if self.values.size == 1:
            return float(self.values.reshape(-1)[0])
        raise ElementError(f"'{self.name}' has {len(self)} samples: write .mean(), .value(time) or [0] for one number")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **keywords: Any) -> Any:
        return numpy_functions.ufunc_of(self, ufunc, method, inputs, keywords)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, args: tuple[Any, ...], keywords: dict[str, Any]
    ) -> Any:
        return numpy_functions.function_of(function, args, keywords)

    # ----------------------------------------------------------------------------------------------------- as an array

    def __iter__(self) -> Iterator[Any]:
        """The samples, oldest first."""
        return iter(self.values)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of `values`: samples first."""
        return tuple(self.values.shape)

    @property
    def ndim(self) -> int:
        """How many dimensions `values` has."""
        return int(self.values.ndim)

    @property
    def size(self) -> int:
        """How many numbers `values` has."""
        return int(self.values.size)

    def any(self) -> bool:
        """Return whether any value is true, or not 0."""
        return bool(np.any(self.numbers("look for truths in")))

    def all(self) -> bool:
        """Return whether all values are true, or not 0."""
        return bool(np.all(self.numbers("look for truths in")))

    def when(self) -> NDArray[np.float64]:
        """Return the times at which a mask becomes true: `(signal > 1).when()`.

        Returns:
            Seconds since start, shape `(n,)`.

        Raises:
            ElementError: it is no mask.
        """
        if self.values.dtype.kind != "b" or self.values.ndim > 1:
            raise ElementError(f"'{self.name}' is no mask; write a comparison: (signal > 1).when()")
        before = np.concatenate([[False], self.values[:-1]])
        times: NDArray[np.float64] = self.times[self.values & ~before[: len(self.values)]]
        return times
