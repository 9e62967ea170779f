"""The blind check's generator: what it hides is there, in the size it says."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.fem.materials import group_by_law
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.mesh import TetMesh
from palpate.segmentation.gap_cases import CHANGES, widened
from palpate.segmentation.simulate_solve import Stiffness
from palpate.segmentation.volume import Volume

RADII = np.array([12.0, 9.0, 15.0])
CENTRE = np.array([3.0, -2.0, 5.0])


@pytest.fixture(scope="module")
def mesh() -> TetMesh:
    found = sphere_in_cube(4, 2, 3, 12.0, 30.0)
    left = found.points[found.cells].mean(axis=1)[:, 0] > 0.0
    return TetMesh(found.points, found.cells, np.where(found.regions == 3, 3, np.where(left, 1, 2)))


@pytest.mark.parametrize("name", sorted(CHANGES))
def test_every_hidden_effect_changes_the_body_it_is_in(name: str, mesh: TetMesh) -> None:
    plain = Stiffness({1: 20.0, 2: 50.0}).materials()
    changed = CHANGES[name](mesh, dict(plain), 0.3, np.random.default_rng(3))
    assert set(changed) == set(plain)
    before, after = (group_by_law(mesh.regions, m) for m in (plain, changed))
    same = len(before) == len(after) and all(
        a.law is b.law and a.values.shape == b.values.shape and np.array_equal(a.values, b.values)
        for a, b in zip(before, after, strict=True)
    )
    assert not same
    assert all(np.isfinite(g.values).all() for g in after)


def ball(points: np.ndarray) -> np.ndarray:
    """An ellipsoid of two halves in tissue."""
    x = (points - CENTRE) / RADII
    inside = (x**2).sum(axis=1) < 1.0
    return np.where(inside, np.where(points[:, 0] > CENTRE[0], 1, 2), 3).astype(np.uint8)


@pytest.mark.parametrize("offset", [1.2, -1.0])
def test_a_widened_contour_lies_that_far_outside(offset: float) -> None:
    affine = np.diag([-1.0, 1.1, 1.5, 1.0])  # an axis that runs the other way
    affine[:3, 3] = [25.0, -22.0, -20.0]
    grid = Volume(np.zeros((45, 40, 34), dtype=np.uint8), affine)
    labels = widened(ball, grid, offset)
    along = np.eye(3)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            edge = CENTRE + sign * (RADII[axis] + offset) * along[axis] + np.array([0.7, 0.0, 0.0]) * (axis > 0)
            inner, outer = edge - 0.45 * sign * along[axis], edge + 0.45 * sign * along[axis]
            assert labels(inner[None])[0] in (1, 2), (axis, sign)
            assert labels(outer[None])[0] == 3, (axis, sign)
