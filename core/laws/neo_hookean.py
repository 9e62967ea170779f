"""Neo-Hookean: psi = G/2 (I1bar - 3) + K/2 (J - 1)^2. Mooney-Rivlin without its mu1 term."""

from __future__ import annotations

import numpy as np

from palpate.core.laws.base import FloatArray, Law
from palpate.core.laws.mooney_rivlin import _kernel as _mooney_rivlin_kernel


def _kernel(F, p, W, g, P, G, A, H, order):  # type: ignore[no-untyped-def]
    as_mooney_rivlin = np.zeros((len(p), 3))
    as_mooney_rivlin[:, 1] = 0.5 * p[:, 0]
    _mooney_rivlin_kernel(F, as_mooney_rivlin, W, g, P, G, A, H, order, 1.0)


def _kappa(p: FloatArray) -> FloatArray:
    return p[:, 1].copy()


def _shear_modulus(p: FloatArray) -> FloatArray:
    return p[:, 0].copy()


NEO_HOOKEAN = Law("neo-hookean", ("G", "K"), _kernel, _kappa, _shear_modulus)
