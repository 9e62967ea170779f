"""The problem with its organ cut out of its surroundings along their common surface, so that the two can slide."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.terms.interface import SplitInterface, open_interface
from palpate.core.problem import IdentificationProblem

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class OpenedProblem:
    """problem : on the opened mesh. split : its two sides. original : (n,) index each point had before."""

    problem: IdentificationProblem
    split: SplitInterface
    original: IntArray


def open_problem(problem: IdentificationProblem) -> OpenedProblem:
    """Raises InputError when organ and tissue share no face."""
    mesh = problem.mesh
    split = open_interface(mesh, problem.regions)
    n = len(mesh.points)
    twins = np.setdiff1d(np.arange(len(split.mesh.points)), np.arange(n))
    original = np.arange(len(split.mesh.points))
    inside = np.isin(mesh.regions, problem.regions)
    twin_of = np.arange(n)
    before, after = mesh.cells[inside].ravel(), split.mesh.cells[inside].ravel()
    twin_of[before] = after
    if len(twins):
        original[after] = before
    organ_faces = {tuple(sorted(f)) for f in mesh.region_boundary(problem.regions)[0].tolist()}
    boundary = {name: _renamed(faces, organ_faces, twin_of) for name, faces in problem.boundary.items()}
    return OpenedProblem(replace(problem, mesh=split.mesh, boundary=boundary), split, original)


def _renamed(faces: IntArray, organ_faces: set[tuple[int, ...]], twin_of: IntArray) -> IntArray:
    """Boundary faces (f, 3) of organ cells take the organ's points."""
    own = np.array([tuple(sorted(f)) in organ_faces for f in faces.tolist()], dtype=bool)
    out = faces.copy()
    out[own] = twin_of[faces[own]]
    return out
