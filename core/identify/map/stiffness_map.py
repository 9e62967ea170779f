"""A stiffness map of the organ: posterior of ln G on patches, each half's own value plus a local deviation (`local_field`).

Data, weights and element are those of the plain fit, of all deformed states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.identify.map.local_field import LocalField, LocalPosterior, Regional
from palpate.core.identify.map.patches import Patches, cut
from palpate.core.identify.map.places import called
from palpate.core.identify.map.sensitivities import patch_sensitivities
from palpate.core.observe.contour_noise import matern_3_2
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, silent

PATCHES = 120
# Share of the prior variance of a deviation that the data take away, from which on a place is shown without hatching: they
# then say more than the prior does.
TOLD = 0.5
# Added to a kernel between patches, for it to be invertible.
_RIDGE = 1e-9
# One deformed state, solved at the fit.
Solved = tuple[CompositionScene, Equilibrium]


@dataclass(frozen=True, eq=False)
class StiffnessMap:
    """Posterior of ln G (G in kPa) on the patches. local : of the deviation from the regions' values. called (n,) : 1
    stiffer than most of its half, -1 softer, 0 not told (`places`)."""

    patches: Patches
    regional: Regional
    local: LocalPosterior
    called: IntArray

    @classmethod
    def of(cls, local: LocalPosterior) -> StiffnessMap:
        """The map of a deviation."""
        return cls(local.model.patches, local.model.regional, local, called(local))

    @property
    def ln_G(self) -> FloatArray:
        """(n,) posterior mean."""
        return np.asarray(self.patches.members @ self.regional.mean + self.local.mean, dtype=np.float64)

    @property
    def covariance(self) -> FloatArray:
        """(n, n) posterior covariance."""
        B = self.patches.members
        both = B @ self.local.cross
        return np.asarray(B @ self.regional.covariance @ B.T + both + both.T + self.local.covariance, dtype=np.float64)

    @property
    def sd(self) -> FloatArray:
        """(n,) standard deviation of ln G."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def told(self) -> BoolArray:
        """(n,) patches where the data say more of a deviation than the prior does."""
        return self.local.model.added >= TOLD

    @property
    def local_sd(self) -> float:
        """Root mean square over the organ of the deviation's posterior mean square."""
        square = np.diag(self.local.covariance) + self.local.mean**2
        return float(np.sqrt(np.average(square, weights=self.patches.volumes)))

    @property
    def blur_mm(self) -> FloatArray:
        """(n,) how far from a patch the places lie whose deviation its value averages."""
        reach = np.abs(self.local.model.resolution) * self.patches.volumes
        distance = cdist(self.patches.centres, self.patches.centres)
        return np.asarray((reach * distance).sum(axis=1) / np.maximum(reach.sum(axis=1), 1e-300), dtype=np.float64)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Arrays of the map's file; `painted` evaluates them. prior and weights : for programs that knew no halves, ln G at x
        is prior[0] + prior[2]^2 k(x, centres) weights, k of length prior[3]."""
        patches, level = self.patches, float(np.average(self.ln_G, weights=self.patches.volumes))
        length, size = self.local.length_mm, max(self.local_sd, _RIDGE)
        kernel = size**2 * (matern_3_2(cdist(patches.centres, patches.centres), length) + _RIDGE * np.eye(patches.n))
        return {
            "centres": patches.centres,
            "volumes_mm3": patches.volumes,
            "patch_region": patches.region,
            "ln_G": self.ln_G,
            "sd": self.sd,
            "covariance": self.covariance,
            "gain": self.local.model.added,
            "told": self.told,
            "called": self.called,
            "regional_ln_G": patches.members @ self.regional.mean,
            "uniform": self.local.uniform,
            "blur_mm": self.blur_mm,
            "resolution": self.local.model.resolution,
            "weights": np.linalg.solve(kernel, self.ln_G - level),
            "prior": np.array([level, 0.0, size, length]),
            "cells": patches.cells,
            "cell_patch": patches.patch,
        }


Arrays = Mapping[str, NDArray[np.generic]]


def painted(arrays: Arrays, points: FloatArray, labels: IntArray | None = None) -> tuple[FloatArray, BoolArray]:
    """G (p,) kPa at points (p, 3) mm of the organ with labels (p,), and whether their patch is told. Between the patches of a
    half it is as the field has it; the halves do not run into each other. arrays : of a map's file, which may be from before
    the map knew halves."""
    ln_G, centres = (np.asarray(arrays[key], dtype=np.float64) for key in ("ln_G", "centres"))
    level, _, _, length = np.asarray(arrays["prior"], dtype=np.float64)
    regional = np.asarray(arrays.get("regional_ln_G", np.full(len(ln_G), level)), dtype=np.float64)
    region, nearest = _region(arrays), nearest_patch(arrays, points, labels)
    out = np.zeros(len(points))
    for half in np.unique(region):
        mine, here = region == half, region[nearest] == half
        kernel = matern_3_2(cdist(centres[mine], centres[mine]), length) + _RIDGE * np.eye(int(mine.sum()))
        weights = np.linalg.solve(kernel, ln_G[mine] - regional[mine])
        out[here] = regional[mine][0] + matern_3_2(cdist(points[here], centres[mine]), length) @ weights
    return np.exp(out), np.asarray(arrays["told"], dtype=bool)[nearest]


def nearest_patch(arrays: Arrays, points: FloatArray, labels: IntArray | None = None) -> IntArray:
    """(p,) patch with the nearest centre to each of points (p, 3) mm; of the same half where labels (p,) say which."""
    distance = cdist(points, np.asarray(arrays["centres"], dtype=float))
    if labels is not None:
        other = np.asarray(labels)[:, None] != _region(arrays)
        distance[other & ~other.all(axis=1, keepdims=True)] = np.inf
    return np.asarray(distance.argmin(axis=1), dtype=np.int64)


def called_at(arrays: Arrays, points: FloatArray, labels: IntArray | None = None) -> IntArray:
    """(p,) 1 where a point's place is told to be stiffer than its half, -1 where softer, 0 elsewhere."""
    nearest = nearest_patch(arrays, points, labels)
    return np.asarray(arrays.get("called", np.zeros(len(arrays["ln_G"]))), dtype=np.int64)[nearest]


def _region(arrays: Arrays) -> IntArray:
    return np.asarray(arrays.get("patch_region", np.zeros(len(arrays["ln_G"]))), dtype=np.int64)


def stiffness_map(
    fit: PlainFit, solved: Sequence[Solved], count: int = PATCHES, progress: Progress = silent
) -> StiffnessMap:
    """The map of a fit. solved : every deformed state at the fit. count : of patches. Noise is widened as that of the regional
    values (`Posterior.scale`)."""
    scene = solved[0][0]
    patches = cut(scene.problem.mesh, scene.problem.regions, count)
    progress(0.0, "stiffness map: what each place does to the data")
    S = patch_sensitivities(fit, solved, patches)
    rows, scale = scene.parameters.stiffness, fit.posterior.scale
    regional = fit.posterior.of(rows)
    # Along a half's common value the derivative is the fit's own.
    S = S + (fit.jacobian[:, rows] - S @ patches.members) @ patches.averages
    progress(0.7, "stiffness map: how much the halves vary")
    field = LocalField(patches, S / scale, Regional(regional.mean, regional.covariance))
    return StiffnessMap.of(field.posterior(fit.residual / scale))
