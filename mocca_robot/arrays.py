"""Arrays as this project types them, and arrays that nobody can write to."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


IntArray: TypeAlias = NDArray[np.int64]


BoolArray: TypeAlias = NDArray[np.bool_]


def read_only(values: object, dtype: type = np.float64) -> NDArray:  # type: ignore[type-arg]
    """Return `values` as a contiguous array that nobody can write to."""
    array: NDArray[Any] = np.array(values, dtype=dtype, order="C")
    array.setflags(write=False)
    return array
