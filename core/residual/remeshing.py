"""The same problem on other meshes: their mean prediction, and the covariance of its error.

A mesh is one of many that the labels allow. Where its edges fall moves the predicted organ smoothly by some hundredths
of a millimetre, which looks like an effect. Independent meshes differ in that alone, so that their mean is nearer to
the truth, and their scatter gives its standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh
from palpate.core.problem import IdentificationProblem


@dataclass(frozen=True, eq=False)
class Remeshed:
    """Another mesh of the same labels. boundary : as in `IdentificationProblem`."""

    mesh: TetMesh
    boundary: dict[str, IntArray]

    def problem(self, like: IdentificationProblem) -> IdentificationProblem:
        """The problem on this mesh."""
        return replace(like, mesh=self.mesh, boundary=self.boundary)

    def arrays(self, prefix: str) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez, names beginning with `prefix`; `all_from` is the inverse."""
        mesh = {"points": self.mesh.points, "cells": self.mesh.cells, "cell_regions": self.mesh.regions}
        out: dict[str, NDArray[np.generic]] = {f"{prefix}/{key}": array for key, array in mesh.items()}
        return out | {f"{prefix}/boundary/{name}": faces for name, faces in self.boundary.items()}


def all_from(arrays: dict[str, NDArray[np.generic]], prefix: str) -> tuple[Remeshed, ...]:
    """Meshes written as prefix/0, prefix/1, ... Raises KeyError when one is incomplete."""
    out: list[Remeshed] = []
    while f"{prefix}/{len(out)}/points" in arrays:
        here = f"{prefix}/{len(out)}"
        mesh = TetMesh(*(np.asarray(arrays[f"{here}/{key}"]) for key in ("points", "cells", "cell_regions")))
        faces = {k.split("/")[-1]: np.asarray(v) for k, v in arrays.items() if k.startswith(f"{here}/boundary/")}
        out.append(Remeshed(mesh, faces))
    return tuple(out)


def what_is_left(differences: FloatArray, share: float) -> FloatArray:
    """Columns (n, 1 + M) mm whose outer products are the covariance of the mean over M meshes; (n, 1) for one, (n, 0)
    for none.

    differences : (M, n) of the better element on every mesh from the one quick prediction. share : of their mean that
    the better element may still err by. The standard error of a mean is the scatter of one mesh over the square root of
    M.
    """
    M = len(differences)
    if M == 0:
        return np.zeros((differences.shape[1], 0))
    mean = differences.mean(axis=0)
    if M == 1:
        return share * mean[:, None]
    scatter = (differences - mean).T / np.sqrt(M * (M - 1.0))
    return np.column_stack([share * mean, scatter])


def left_by_all(differences: Sequence[FloatArray], share: float) -> FloatArray:
    """Columns (n, m) for all deformed states; the better element's own error has the same share in all of them."""
    each = [what_is_left(d, share) for d in differences]
    common = np.concatenate([e[:, 0] if e.shape[1] else np.zeros(len(e)) for e in each])
    return np.column_stack([common, block_diag(*(e[:, 1:] for e in each))])
