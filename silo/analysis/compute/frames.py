"""Rotations of signals: vectors into other frames, quaternions and Euler angles into each other.

Built on scipy's `Rotation` (an extra). Quaternions are `x y z w`, or in another order if their components say so.
Samples that are no rotation (NaN, length zero) give NaN and disturb no other.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.arithmetic import together
from silo.analysis.compute.samples import XYZW, Samples, in_order
from silo.core import units
from silo.core.arguments import shown, text
from silo.errors import ElementError
from silo.files.optional_packages import need

_WHAT = "rotations"

One = TypeVar("One", bound=Samples)


def rotate(vector: One, orientation: Samples, inverse: bool = False) -> One:
    """Return the 3-vector turned by the quaternion, at the stamps of the faster of both.

    With the orientation of a body in the world, `rotate` takes a vector of the body's frame to the world's, and
    `inverse=True` one of the world's to the body's. Raises `ElementError` if shapes don't fit.
    """
    _expect(vector, 3, "a 3-vector")
    _expect(orientation, 4, "a quaternion")
    left, right = together(vector, in_order(orientation, XYZW), f"rotate '{vector.name}' by '{orientation.name}'")
    good = _is_rotation(right.values)
    rotations = _rotation().from_quat(right.values[good].astype(np.float64))
    values = np.full((len(left), 3), np.nan)
    values[good] = rotations.apply(left.values[good].astype(np.float64), inverse=inverse)
    return replace(left, values=values)


def euler(orientation: One, order: str = "ZYX", degrees: bool = False) -> One:
    """Return Euler angles of a quaternion in the order of their axes; upper case: intrinsic, lower case: fixed axes."""
    _expect(orientation, 4, "a quaternion")
    _check_order(order)
    angles = _convert(orientation, 3, lambda rotations: rotations.as_euler(order, degrees=degrees))
    return replace(
        orientation,
        name=f"euler({orientation.name})",
        values=angles,
        kind="vector",
        unit="deg" if degrees else "rad",
        components=tuple(f"{place}_{axis.lower()}" for place, axis in enumerate(order)),
    )


def quaternion(signal: One, order: str = "ZYX", degrees: bool | None = None) -> One:
    """Return the quaternion of Euler angles (in this order), of an angle-axis, or of 3 x 3 rotation matrices.

    Angles are in the signal's unit unless `degrees` is given, in radians where it has none.
    """
    rotation = _rotation()
    values = signal.values
    good = np.isfinite(values.reshape(len(signal), -1)).all(axis=1)
    chosen = values[good].astype(np.float64)
    in_rad = (units.factor(signal.unit, "rad") or 1.0) if degrees is None else np.radians(1.0) if degrees else 1.0
    if signal.kind == "angle_axis" and values.shape[1:] == (4,):
        lengths = np.linalg.norm(chosen[:, 1:], axis=1, keepdims=True)
        made = rotation.from_rotvec(in_rad * chosen[:, :1] * chosen[:, 1:] / np.where(lengths > 0, lengths, 1))
    elif values.shape[1:] == (3, 3):
        made = rotation.from_matrix(chosen)
    else:
        _expect(signal, 3, "Euler angles, an angle-axis or a 3 x 3 matrix")
        _check_order(order)
        made = rotation.from_euler(order, in_rad * chosen)
    result = np.full((len(signal), 4), np.nan)
    result[good] = made.as_quat()
    return replace(
        signal, name=f"quaternion({signal.name})", values=result, kind="quaternion", unit="-", components=XYZW
    )


def inverse(orientation: One) -> One:
    """Return the inverse rotation."""
    _expect(orientation, 4, "a quaternion")
    values = _convert(orientation, 4, lambda rotations: rotations.inv().as_quat())
    made = replace(in_order(orientation, XYZW), name=f"inverse({orientation.name})", values=values)
    return in_order(made, orientation.components)


def _rotation() -> Any:
    return need("scipy.spatial.transform", "analysis", _WHAT).Rotation


def _convert(orientation: Samples, width: int, function: Callable[[Any], NDArray[Any]]) -> NDArray[np.float64]:
    quaternions = in_order(orientation, XYZW).values
    good = _is_rotation(quaternions)
    values = np.full((len(orientation), width), np.nan)
    values[good] = function(_rotation().from_quat(quaternions[good].astype(np.float64)))
    return values


def _is_rotation(values: NDArray[Any]) -> NDArray[np.bool_]:
    lengths = np.linalg.norm(values.astype(np.float64), axis=1)
    good: NDArray[np.bool_] = np.isfinite(lengths) & (lengths > 0)
    return good


def _expect(signal: Samples, width: int, what: str) -> None:
    if not isinstance(signal, Samples):
        raise ElementError(f"{what} must be a signal, got {shown(signal)}; write log['/log/base/orientation']")
    if signal.values.shape[1:] != (width,) or signal.values.dtype.kind not in "iuf":
        raise ElementError(f"'{signal.name}' is not {what}: one sample has shape {signal.values.shape[1:]}")


def _check_order(order: str) -> None:
    axes = text("the order of Euler angles", order, "order='ZYX'").lower()
    one_case = order in (axes, order.upper())
    repeated = any(one == next_one for one, next_one in pairwise(axes))
    if len(order) != 3 or not set(axes) <= set("xyz") or not one_case or repeated:
        raise ElementError(f"no order of Euler angles: {order!r}; take three of xyz (fixed) or XYZ (intrinsic axes)")
