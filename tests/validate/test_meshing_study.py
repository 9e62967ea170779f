"""The figures of a mesh against its labels, on shapes whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshedCase, assemble
from palpate.validate.meshing_study import (
    contact_of_labels,
    contact_of_mesh,
    distance_from_outline,
    points_on_organ,
    row_of,
    study_text,
)

SPACING = np.array([1.0, 1.5, 3.0])
# A brick is cut into cubes, and each cube into six tetrahedra about its diagonal.
_KUHN = [(0, 1, 3, 7), (0, 1, 5, 7), (0, 2, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 4, 6, 7)]


def _labels() -> Volume:
    """Organ (1, 2) of 12 x 9 x 12 mm in tissue; the rectum lies on half of its face towards -y."""
    array = np.full((20, 16, 10), 3, dtype=np.uint8)
    array[4:10, 5:11, 3:7], array[10:16, 5:11, 3:7] = 1, 2
    array[4:10, 2:5, 3:7] = 6
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = [-7.0, 20.0, 3.0]
    return Volume(array, affine)


def _meshed(labels: Volume, grown: float = 0.0) -> MeshedCase:
    """The voxels as tetrahedra, two voxels a side at most; the organ's points moved out along x by ``grown`` mm."""
    n = np.array(labels.array.shape)
    node = np.arange(np.prod(n + 1)).reshape(n + 1)
    corner = [node[i : i + n[0], j : j + n[1], k : k + n[2]].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    cells = np.concatenate([np.column_stack([corner[c] for c in tet]) for tet in _KUHN])
    index = np.indices(n + 1).reshape(3, -1).T - 0.5
    points = labels.to_lps(index)
    points[:, 0] += np.where(np.abs(points[:, 0] - 2.5) < 6.6, grown * np.sign(points[:, 0] - 2.5), 0.0)
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    mesh, boundary = assemble(points, cells, np.tile(labels.array.ravel().astype(np.int64), 6))
    return MeshedCase(mesh, boundary, _quality(mesh))


def _quality(mesh: TetMesh) -> dict[str, object]:
    regions = {str(r): {"volume_error": 0.001 * r} for r in (1, 2, 3)}
    return {
        "cells": len(mesh.cells),
        "min_dihedral_deg": 20.0,
        "slivers": 0,
        "regions": regions,
        "attempts": 1,
        "surfaces": {},
    }


def test_a_mesh_on_the_voxels_is_on_their_outline() -> None:
    labels = _labels()
    assert np.abs(distance_from_outline(labels, points_on_organ(_meshed(labels)))).max() < 0.3


def test_a_mesh_half_a_millimetre_out_is_half_a_millimetre_out() -> None:
    labels = _labels()
    away = distance_from_outline(labels, points_on_organ(_meshed(labels, grown=0.6)))
    assert np.percentile(away, 95) == pytest.approx(0.6, abs=0.25)
    assert abs(np.median(away)) < 0.3


def test_distance_in_voxels_counts_each_axis_by_its_own_edge() -> None:
    labels = _labels()
    middle = labels.to_lps(np.array([[9.5, 7.5, 4.5]]))
    out = middle + [[0.0, 0.0, 2.0 * 3.0 + 1.5], [6.0 + 0.5, 0.0, 0.0], [0.0, -(3.0 * 1.5 + 0.75), 0.0]]
    assert distance_from_outline(labels, out, in_voxels=True) == pytest.approx([0.5, 0.5, 0.5], abs=0.1)
    assert distance_from_outline(labels, out) == pytest.approx([1.5, 0.5, 0.75], abs=0.25)


def test_contact_with_the_rectum_is_its_area() -> None:
    labels = _labels()
    assert contact_of_labels(labels) == pytest.approx(6 * 1.0 * 4 * 3.0)
    assert contact_of_mesh(_meshed(labels)) == pytest.approx(contact_of_labels(labels))


def test_a_row_says_what_was_missed() -> None:
    labels = _labels()
    row = row_of("made up", labels, _meshed(labels), seconds=75.0)
    assert row["checks"] == {"angle": True, "volume": True, "surface": True, "seconds": False}
    assert row["worst_volume_error"] == pytest.approx(0.003)
    assert row["surface_p95_voxels"] < 0.3
    assert 0.2 < row["smooth_outline_p95_mm"] < 2.0
    assert "not reached: seconds" in study_text({"rows": [row]})
