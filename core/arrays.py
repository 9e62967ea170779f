"""Types of arrays, stated once. Arrays are C-ordered; the first axis is points, cells or particles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
LabelArray = NDArray[np.uint8]
# Of whatever number type a file has.
NumberArray = NDArray[Any]
