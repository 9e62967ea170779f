"""Scores of windows: what two scans say of the motion, for any motion within a window.

About a reference motion r the difference of the scans is, to first order, the gradient g times what the true motion u is
beyond it. A window's score, the mean of g (first - second moved by r), is therefore the mean of g g' (u - r), whatever u
does within the window (integrated digital volume correlation; Hild & Roux 2006). Brightness and contrast are taken out of
g as in the fit of a shift. The noise has a gradient of its own that moves with nothing: its share in g g' is taken off.
Errors of two windows go along as far as both see the same voxels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial.distance import cdist

from palpate.core.arrays import Float32Array, FloatArray, IntArray
from palpate.core.window_scores import WindowScores
from palpate.imaging.matching.noise import CorrelatedNoise, measured_correlation
from palpate.imaging.matching.scan_pair import Motion, ScanPair
from palpate.imaging.matching.window_errors import noise_of_gradient, variance_left
from palpate.imaging.matching.window_fits import NormalEquations
from palpate.imaging.matching.window_sums import Windows, pairs, symmetric

# Distance of the nodes between which the motion beyond the reference is linear, mm: less than a window's half.
NODES_MM = 4.0
# Distance of the nodes about which the noise is summed, mm: less than a window's standard deviation.
FINE_MM = 2.0
# Windows have errors in common where the product of their weights is more than this, over what it is for one of them.
_COMMON = 1e-4


@dataclass(frozen=True, eq=False)
class Compared:
    """Both scans under a reference motion (n, 3) mm at points (n, 3) mm, and the equations of all windows there."""

    pair: ScanPair
    at: NormalEquations
    reference: Motion


def window_scores(compared: Compared, windows: IntArray) -> WindowScores:
    """Scores of windows (w, 3), indices of the lattice's nodes."""
    pair, at = compared.pair, compared.at
    index = tuple(windows.T)
    noise = measured_correlation(at.difference, at.weight > 0.5)
    variance, middles = variance_left(pair, at)[index], pair.windows.nodes[index]
    lattice = Windows.of(pair.grid, pair.windows.sigma_mm, step_mm=NODES_MM)
    slope = noise_of_gradient(noise, pair.grid.spacing, at.noise_of_mean)
    response = _responses(pair, at, windows, lattice, variance[:, None] * slope)
    used = np.unique(response.indices // 3)
    nodes = lattice.nodes.reshape(-1, 3)[used]
    response = response[:, (3 * used[:, None] + np.arange(3)).ravel()]
    together, blocks = _covariances(pair, at, windows, middles, variance, noise)
    value = at.right[index].ravel() + response @ compared.reference(nodes).ravel()
    itself = together[:, 0] == together[:, 1]
    sd = np.sqrt(np.maximum(np.einsum("kaa->ka", blocks[itself]), 1e-12))
    blocks = blocks / (sd[together[:, 0], :, None] * sd[together[:, 1], None, :])
    scaled = sp.diags(1.0 / sd.ravel()) @ response
    return WindowScores(middles, nodes, scaled.tocsr(), value / sd.ravel(), together, blocks)


def _responses(
    pair: ScanPair, at: NormalEquations, windows: IntArray, lattice: Windows, of_noise: FloatArray
) -> sp.csr_matrix:
    """Means (3 w, 3 p) HU2/mm2 of g g' times the hat of every node. of_noise (w, 3) : what noise adds to the squares."""
    shape = lattice.lattice.array.shape
    rows, columns, values = [], [], []
    for n, (window, extra) in enumerate(zip(windows, of_noise, strict=True)):
        box, weight = _weights(pair, at, window)
        g = np.stack([f[box] for f in at.gradient])
        nuisance = np.stack([f[box] for f in at.nuisance])
        own = g - np.einsum("ca,cxyz->axyz", at.mixed[tuple(window)], nuisance)
        square = np.einsum("xyz,axyz,bxyz->abxyz", weight, own, g)
        square[np.arange(3), np.arange(3)] -= extra[:, None, None, None] * weight
        hats = [lattice.hats[a][box[a]] for a in range(3)]
        near = [np.flatnonzero(h.any(axis=0)) for h in hats]
        sums = np.einsum(
            "abxyz,xp,yq,zr->abpqr", square, *(h[:, c] for h, c in zip(hats, near, strict=True)), optimize=True
        )
        node = np.ravel_multi_index(np.meshgrid(*near, indexing="ij"), shape).ravel()
        a, b, k = np.meshgrid(np.arange(3), np.arange(3), node, indexing="ij")
        rows.append((3 * n + a).ravel())
        columns.append((3 * k + b).ravel())
        values.append(sums.ravel())
    size = (3 * len(windows), 3 * int(np.prod(shape)))
    return sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=size)


def _weights(pair: ScanPair, at: NormalEquations, window: IntArray) -> tuple[tuple[slice, ...], Float32Array]:
    """The voxels of a window, and their weights there."""
    each = [pair.windows.weights[a][q] for a, q in enumerate(window)]
    inside = [np.flatnonzero(w) for w in each]
    box = tuple(slice(int(i[0]), int(i[-1]) + 1) for i in inside)
    x, y, z = (w[b] for w, b in zip(each, box, strict=True))
    return box, x[:, None, None] * y[None, :, None] * z * at.weight[box]


def _covariances(
    pair: ScanPair,
    at: NormalEquations,
    windows: IntArray,
    middles: FloatArray,
    variance: FloatArray,
    noise: CorrelatedNoise,
) -> tuple[IntArray, FloatArray]:
    """Pairs (k, 2) of windows with common errors, and the covariance (k, 3, 3) of their scores.

    It is F F', with a column of F for each of five independent errors about every node of a fine lattice: of the noise's sums
    with gradient, brightness and contrast there.
    """
    fine = Windows.of(pair.grid, pair.windows.sigma_mm, step_mm=FINE_MM)
    root = _roots(fine, at, noise)
    at_nodes, shape = pair.windows.weights_at(fine.axes), fine.lattice.array.shape
    out = np.concatenate(
        [np.tile(np.eye(3), (len(windows), 1, 1)), -np.swapaxes(at.mixed[tuple(windows.T)], 1, 2)], axis=2
    )
    rows, columns, values = [], [], []
    for n, window in enumerate(windows):
        each = [w[q] for w, q in zip(at_nodes, window, strict=True)]
        near = [np.flatnonzero(w) for w in each]
        weight = np.einsum("x,y,z->xyz", *(w[i] for w, i in zip(each, near, strict=True))).ravel()
        node = np.ravel_multi_index(np.meshgrid(*near, indexing="ij"), shape).ravel()
        factor = weight[:, None, None] * (np.sqrt(variance[n]) * out[n] @ root[node])
        k, a, b = np.meshgrid(node, np.arange(3), np.arange(5), indexing="ij")
        rows.append((3 * n + a).ravel())
        columns.append((5 * k + b).ravel())
        values.append(factor.ravel())
    size = (3 * len(windows), 5 * len(root))
    F = sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=size)
    full = (F @ F.T).toarray().reshape(len(windows), 3, len(windows), 3)
    share = np.exp(-0.25 * (cdist(middles, middles) / pair.windows.sigma_mm) ** 2)
    first, second = np.nonzero(np.triu(share > _COMMON))
    return np.column_stack([first, second]), full[first, :, second, :]


def _roots(fine: Windows, at: NormalEquations, noise: CorrelatedNoise) -> FloatArray:
    """Symmetric roots (k, 5, 5) of the covariance of noise of unit variance with gradient, brightness and contrast, summed
    about the nodes of a lattice."""
    weighted: list[Float32Array] = [at.weight * f for f in (*at.gradient, *at.nuisance)]
    noise = noise.in_windows(fine.sigma_mm, fine.spacing)
    spread = [noise.applied(f) for f in weighted]
    half = np.float32(0.5)
    sums = {(i, j): half * fine.gathered(weighted[i] * spread[j] + weighted[j] * spread[i]) for i, j in pairs(5)}
    value, vector = np.linalg.eigh(symmetric(sums, 5).reshape(-1, 5, 5))
    return np.asarray(np.einsum("kij,kj,klj->kil", vector, np.sqrt(np.maximum(value, 0.0)), vector))
