# SPDX-License-Identifier: MIT
"""From NumPy's arrays to the library's (ascc_array), and never beyond their ends.

The library takes rows of float or double at any distances, but reads a stride of 0 as "packed". NumPy's
stride of 0 means "the same again", so such arrays are copied before they are read and refused where
they would be written.
"""

from typing import Any, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._library import Array

Numbers = NDArray[Any]


def _is_native(array: Numbers) -> bool:
    return array.dtype in (np.dtype(np.float32), np.dtype(np.float64)) and array.dtype.isnative


def _repeats(array: Numbers) -> bool:
    """Whether an axis is one element again and again, as broadcasting makes it."""
    axes = zip(array.strides, array.shape)
    return array.size > 0 and any(stride == 0 and extent > 1 for stride, extent in axes)


def _describe(array: Numbers) -> Array:
    """array [rows][components] as the library takes it; strides of axes without a second element do not matter."""
    size = array.itemsize
    rows, components = array.shape
    component = array.strides[1] if components > 1 else size
    row = array.strides[0] if rows > 1 else size * components
    return Array(
        data=array.ctypes.data,
        stride=row,
        component_stride=component,
        scalar=0 if array.dtype == np.float32 else 1,
    )


def _numbers(name: str, values: ArrayLike) -> Numbers:
    array: Numbers = np.asarray(values)
    if _is_native(array):
        return array
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: {array.dtype}: numbers are wanted")
    return array.astype(np.float64)


def rows_of(name: str, values: ArrayLike, components: int) -> Numbers:
    """values as [rows][components] that the library can read, in place where it can be."""
    array = _numbers(name, values)
    if components == 1 and array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] != components:
        wanted = "[rows]" if components == 1 else f"[rows, {components}]"
        raise ValueError(f"{name}: shape {list(array.shape)}, {wanted} is wanted")
    return np.ascontiguousarray(array) if _repeats(array) else array


def rows_for(name: str, values: ArrayLike, rows: int, components: int) -> Numbers:
    """The same for as many rows as are wanted; one number, or one row, stands for all."""
    array = _numbers(name, values)
    if array.ndim == 0 or (array.ndim == 1 and components > 1):
        try:
            array = np.broadcast_to(array, (rows, components))
        except ValueError:
            raise ValueError(
                f"{name}: shape {list(array.shape)}, one number or {components} are wanted"
            ) from None
    array = rows_of(name, array, components)
    if len(array) != rows:
        raise ValueError(f"{name}: {len(array)} rows, {rows} are wanted")
    return array


def borrowed(array: Numbers) -> Array:
    """What the library reads; the array must outlive the call."""
    return _describe(array)


def written(name: str, out: Any, shape: Tuple[int, ...]) -> Tuple[Array, Numbers]:
    """What the library writes of the caller's own array."""
    if not isinstance(out, np.ndarray) or not _is_native(out):
        raise TypeError(f"{name}: an array of float32 or float64 is wanted")
    if out.shape != shape:
        raise ValueError(f"{name}: shape {list(out.shape)}, {list(shape)} is wanted")
    if not out.flags.writeable or _repeats(out):
        raise ValueError(f"{name}: not to be written: read-only, or one element repeated")
    return _describe(out if out.ndim == 2 else out[:, None]), out
