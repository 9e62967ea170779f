"""Places that are stiffer or softer than most of their half, by the posterior of the local deviation.

The largest set of places whose signs are all right at once with the stated probability (Bolin & Lindgren 2015, excursion
sets). A draw without a deviation in a half is one in which no place there differs: a call needs odds of 19 to 1 against
that. Prior odds are even and the likelihood ratio of uniform halves has a mean of 1, so that they reach such odds in at
most one pair of nineteen (Markov's inequality).
"""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.map.local_field import LocalPosterior

# Probability that all places that are called differ from their half as said.
LEVEL = 0.95
# Draws of the field: a probability of 0.95 is right to 0.003.
_DRAWS, _SEED = 4000, 1


def called(posterior: LocalPosterior, level: float = LEVEL) -> IntArray:
    """(n,) 1 where a patch is stiffer than the median of its half, -1 where it is softer, 0 where neither is told."""
    differs = _signs(posterior, posterior.draws(_DRAWS, np.random.default_rng(_SEED)))
    up, down = (differs > 0).mean(axis=0), (differs < 0).mean(axis=0)
    sign = np.where(up >= down, 1, -1)
    order = np.argsort(-np.maximum(up, down), kind="stable")
    right = np.logical_and.accumulate((differs == sign)[:, order], axis=1).mean(axis=0)
    out = np.zeros(len(sign), dtype=np.int64)
    kept = order[: int((right >= level).sum())]
    out[kept] = sign[kept]
    return out


def _signs(posterior: LocalPosterior, draws: FloatArray) -> IntArray:
    patches, out = posterior.model.patches, np.zeros(draws.shape, dtype=np.int64)
    for region in patches.regions:
        mine = patches.region == region
        out[:, mine] = np.sign(draws[:, mine] - np.median(draws[:, mine], axis=1, keepdims=True))
    return out
