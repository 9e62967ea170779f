"""How uneven each region is, told by the data; and what an uneven region does is not what its mean stiffness does."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.identify.uneven_regions import amplitudes, uneven_responses
from palpate.validate.paper.tumour_scene import Divisions, DrivenScene, halved_ball


def test_the_uneven_region_is_named_and_the_uniform_one_gets_nothing() -> None:
    rng = np.random.default_rng(3)
    responses = [rng.standard_normal((120, 40)) * np.exp(-np.arange(40) / 10.0) for _ in "ab"]
    covariance = 0.05**2 * np.eye(120)
    found = []
    for _ in range(6):
        residual = 0.6 * responses[0] @ rng.standard_normal(40) + 0.05 * rng.standard_normal(120)
        found.append(amplitudes(covariance, responses, residual))
    assert np.median(found, axis=0)[0] == pytest.approx(0.6, rel=0.3)
    assert np.max(found, axis=0)[1] <= 0.05
    assert (amplitudes(covariance, responses, 0.05 * rng.standard_normal(120)) <= 0.02).all()


def test_a_field_that_is_counted_as_an_error_leaves_the_regions_mean_alone() -> None:
    """Seen in the half's mean strain, which follows its effective stiffness."""
    scene = DrivenScene(halved_ball(Divisions(2, 1, 1)), "p1p1", 0.02)
    theta = np.log([120.0, 200.0])
    found = scene.solve(theta)
    cells = np.flatnonzero(scene.mesh.regions == 1)

    def mean_strain(u: np.ndarray) -> np.ndarray:
        F, weight = scene.assembler.deformation_gradients(u)[cells], scene.assembler.weight[cells]
        strain = 0.5 * (F + np.swapaxes(F, 2, 3)) - np.eye(3)
        strain -= np.trace(strain, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
        return np.asarray(np.einsum("cq,cqij->ij", weight, strain).ravel())

    at_rest = mean_strain(np.zeros_like(found.u))
    base = mean_strain(found.u) - at_rest
    own = scene.displacement_sensitivities(theta, found)[0]
    along = (mean_strain(own) - at_rest) @ base
    left, _ = uneven_responses(
        scene.assembler, scene.parameters, theta, found, lambda du: np.array([(mean_strain(du) - at_rest) @ base])
    )
    # All of a factor of e in the half's own stiffness, against what the field does at one standard deviation.
    assert np.linalg.norm(left) < 0.1 * abs(along)
