"""The projection that makes a Newton step descend (Teran et al. 2005, Robust quasistatic finite elements, section
5).
"""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray


def nearest_positive_semidefinite(A: FloatArray) -> FloatArray:
    """Symmetric matrices (..., k, k) with their negative eigenvalues set to zero; the others are returned unchanged."""
    out = np.array(A)
    flat = out.reshape(-1, *A.shape[-2:])
    lowest = np.linalg.eigvalsh(flat)[:, 0] if len(flat) else np.zeros(0)
    bad = np.flatnonzero(lowest < 0.0)
    if len(bad):
        w, V = np.linalg.eigh(flat[bad])
        flat[bad] = np.einsum("nik,nk,njk->nij", V, np.maximum(w, 0.0), V)
    return out
