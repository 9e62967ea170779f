"""Anderson's mixing of the changes of a fixed-point iteration (Walker & Ni 2011, SIAM J. Numer. Anal. 49:1715,
algorithm AA).
"""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray

_HISTORY = 6


class Mixing:
    """measured : how many leading entries of a change the fit looks at (displacements, not pressures)."""

    def __init__(self, measured: int) -> None:
        self._measured = measured
        self._step: FloatArray | None = None
        self._taken: FloatArray | None = None
        self._changes: list[FloatArray] = []
        self._differences: list[FloatArray] = []

    def mixed(self, step: FloatArray) -> FloatArray:
        """The change to make where the iteration asks for `step` (n,): with the part removed that earlier changes show
        to be overshoot.
        """
        if self._step is not None and self._taken is not None:
            self._changes = [*self._changes, self._taken][-_HISTORY:]
            self._differences = [*self._differences, step - self._step][-_HISTORY:]
        taken = step
        if self._differences:
            D = np.array(self._differences)
            part = D[:, : self._measured]
            c = np.linalg.lstsq(part @ part.T, part @ step[: self._measured], rcond=1e-12)[0]
            taken = step - c @ (np.array(self._changes) + D)
        self._step, self._taken = step, taken
        return taken
