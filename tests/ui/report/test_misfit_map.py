"""The picture of the misfit shows the distances that the table is made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from phantoms import write_case

from palpate.case.case_folder import CaseFolder
from palpate.ui.report.figures import misfit_map

RADIUS, TOO_FAR = 20.0, 1.5


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    """A ball that moved 5 mm to the left, predicted 1.5 mm too large in front; compared at 2,000 points off its corners."""
    made = write_case(tmp_path / "case")
    ball = pv.Sphere(radius=RADIUS, theta_resolution=60, phi_resolution=60)
    points, faces = np.asarray(ball.points, dtype=float), ball.regular_faces.astype(np.int64)
    arrays = {}
    for state, x in (("rest", 0.0), ("deformed", 5.0)):
        arrays |= {f"{state}_organ_points": points + [x, 0.0, 0.0], f"{state}_organ_faces": faces,
                   f"{state}_organ_region": np.ones(len(faces), dtype=np.int64)}  # fmt: skip
    made.write_npz("surfaces.npz", **arrays)
    at = np.random.default_rng(0).standard_normal((2000, 3))
    at *= RADIUS / np.linalg.norm(at, axis=1)[:, None]
    move = np.array([5.0, 0.0, 0.0]) + np.where(at[:, 1:2] < 0.0, TOO_FAR * at / RADIUS, 0.0)
    made.write_npz("identify/fields.npz", surface_points=at, surface_displacement=move)
    return made


def test_distances_are_those_of_the_compared_points_with_their_sign(case: CaseFolder) -> None:
    found = misfit_map(case, 0.5)
    front = found.points[:, 1] < -8.0
    behind = found.points[:, 1] > 8.0
    assert found.distance[front] == pytest.approx(TOO_FAR, abs=0.1), "outside is positive"
    assert found.distance[behind] == pytest.approx(0.0, abs=0.1)
    assert found.greatest_mm == pytest.approx(TOO_FAR, abs=0.05)


def test_the_surface_is_drawn_where_it_was_predicted(case: CaseFolder) -> None:
    found = misfit_map(case, None)
    from_middle = np.linalg.norm(found.points - [5.0, 0.0, 0.0], axis=1)
    assert from_middle[found.points[:, 1] < -8.0] == pytest.approx(RADIUS + TOO_FAR, abs=0.15)
    assert from_middle[found.points[:, 1] > 8.0] == pytest.approx(RADIUS, abs=0.15)
