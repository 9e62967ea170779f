"""Is there a gap at all? The plain model's residual against what noise alone would leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from palpate.core.gap.evidence import explained, projected

FloatArray = NDArray[np.float64]

LEVEL = 0.05
_DRAWS = 4000


@dataclass(frozen=True)
class GapTest:
    """statistic Q, its degrees of freedom, p_value of the whole test, p_smooth of its smooth part alone."""

    statistic: float
    freedom: int
    p_value: float
    p_smooth: float

    @property
    def detected(self) -> bool:
        """Whether noise alone would leave this much in fewer than one case of twenty."""
        return self.p_value < LEVEL


def gap_test(r: FloatArray, J: FloatArray, fields: FloatArray, seed: int = 1) -> GapTest:
    """Two looks at the whitened residual r (n,), the stiffness J (n, t) projected out, one p-value (Bonferroni's).

    Q = r'Mr sees any excess; b'(I + A)^-1 b, the gain of a free smooth field of missing forces (n, k), sees what effects look like.
    The second has no tabled distribution: it is drawn under the plain model.
    """
    freedom = len(r) - J.shape[1]
    Q = explained(r, J)
    p_whole = float(stats.chi2.sf(Q, freedom))
    U, s, _ = np.linalg.svd(projected(J, fields), full_matrices=False)
    weight = s**2 / (1.0 + s**2)
    found = float(weight @ (U.T @ projected(J, r)) ** 2)
    draws = np.random.default_rng(seed).standard_normal((_DRAWS, len(weight))) ** 2 @ weight
    p_smooth = float((1 + (draws >= found).sum()) / (1 + _DRAWS))
    return GapTest(Q, freedom, min(1.0, 2.0 * min(p_whole, p_smooth)), p_smooth)
