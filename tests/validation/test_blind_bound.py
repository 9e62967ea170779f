"""The weights against the Cramer-Rao bound of the blind cases without a hidden effect, from the answers' own sensitivities.

In short: no mesh and no solve. In full: `palpate identify CASE --method gauss-newton` on each, see the README.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from palpate.core.observe.noise import Weighting, stated_covariance

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data"
CASES = {"case_004": "blind_dev", "case_006": "blind_dev", "case_304": "blind_dev_b", "case_306": "blind_dev_b"}


@pytest.mark.shared_data
@pytest.mark.parametrize("name", CASES)
def test_intervals_are_near_what_these_contours_allow(name: str) -> None:
    answers = SHARED / CASES[name] / "answers"
    if not answers.is_dir():
        pytest.skip(f"{answers} is not there")
    facts = json.loads((answers / f"{name}.json").read_text())
    with np.load(answers / f"{name}_surface.npz") as surface:
        points, normal = surface["surface_rest"], surface["normal_rest"]
        J = np.stack([(surface[f"dudlnG_{side}"] * normal).sum(axis=1) for side in ("left", "right")], axis=1)
    sd, length = facts["noise_sd_mm"], facts["noise_correlation_length_mm"]
    # Both contours' noise as the answers state it. A smooth kernel alone has no bound that means anything, since its inverse
    # sees detail of micrometres: a twentieth of a millimetre, far below a voxel, is taken as what cannot be seen.
    r2 = cdist(points, points) ** 2
    noise = 2.0 * sd**2 * np.exp(-0.5 * r2 / length**2) + 0.05**2 * np.eye(len(points))
    bound = np.sqrt(np.diag(np.linalg.inv(J.T @ np.linalg.solve(noise, J))))
    # A person knows the noise's size, not its length.
    white = Weighting(stated_covariance(points, sd, 7.0)).whiten(J)
    claimed = np.sqrt(np.diag(np.linalg.inv(white.T @ white)))
    assert (claimed < 1.5 * bound).all()
    assert (claimed > 0.95 * bound).all()
