"""mu1 and mu2 looked for apart: what a pair tells of them, and what it says where it does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import synthetic_case

from palpate.core.files.json_types import plain
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.forward.parameters import SHARE_BOUNDS, StiffnessParameters
from palpate.core.identify.job import run
from palpate.core.identify.mu_split import separable
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.inference.posterior import Posterior, verdict
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

NAMES = ("prostate_left", "prostate_right")


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    return synthetic_case.problem((30.0, 70.0), fine=2)


@pytest.fixture(scope="module")
def result(problem: IdentificationProblem, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("split")
    noisy = replace(problem, facts=replace(problem.facts, noise_sd_mm=0.2))
    np.savez(folder / "problem.npz", **noisy.arrays())
    options = {"element": "p1p1", "starts": 2, "method": "gauss-newton", "stiffness_map": False, "split_mu": True}
    paths = {"problem": str(folder / "problem.npz")}
    return plain(run(Job("palpate.core.identify.job:run", str(folder), paths, options), Reporter(lambda message: None)))


def test_a_pair_with_noise_says_that_it_cannot_tell_mu1_from_mu2(result: dict[str, Any]) -> None:
    assert not result["identifiability"]["mu1_mu2_separable"]
    assert "prostate left: mu1 and mu2 cannot be told apart" in result["identifiability"]["verdict"]
    for found in result["parameters"].values():
        low, high = found["mu1_share_ci95"]
        # 95 % of what was allowed: the interval spans the prior.
        assert high - low > 0.9 * (SHARE_BOUNDS[1] - SHARE_BOUNDS[0])
        assert found["mu1_ci95_kpa"][1] > 10.0 * found["mu1_ci95_kpa"][0]


def test_their_sum_is_found_all_the_same(result: dict[str, Any]) -> None:
    for found, true in zip(result["parameters"].values(), (30.0, 70.0), strict=True):
        assert found["ci95_kpa"][0] < true < found["ci95_kpa"][1]
        assert found["G_kpa"] == pytest.approx(2.0 * (found["mu1_kpa"] + found["mu2_kpa"]))
        for name in ("mu1", "mu2"):
            low, high = found[f"{name}_ci95_kpa"]
            assert low <= found[f"{name}_kpa"] <= high
            assert high < 0.5 * 1.3 * found["ci95_kpa"][1]


def test_displacements_follow_the_share_as_their_sensitivities_say(problem: IdentificationProblem) -> None:
    scene = plain_scene(problem, "p1p1", split_mu=True)
    theta = np.array([np.log(30.0), 0.3, np.log(70.0), 0.6])
    settled = scene.settle(theta).equilibrium
    slopes = scene.displacement_sensitivities(theta, settled)
    h = 1e-3
    for k in range(4):
        ahead, behind = (scene.solve(theta + s * h * np.eye(4)[k], settled.u).u for s in (1.0, -1.0))
        np.testing.assert_allclose((ahead - behind) / (2.0 * h), slopes[k], atol=2e-3 * np.abs(slopes[k]).max())


def test_a_share_that_is_known_is_said_with_its_interval() -> None:
    parameters = StiffnessParameters((1, 2), synthetic_case.FACTS, split_mu=True)
    assert parameters.mu(np.array([np.log(40.0), 0.25, np.log(8.0), 0.5])) == pytest.approx(
        np.array([[5.0, 15.0], [2.0, 2.0]])
    )
    covariance = np.diag([0.1, 0.03, 0.1, 0.27]) ** 2
    mean = np.array([np.log(40.0), 0.25, np.log(8.0), 0.5])
    posterior = Posterior(mean, covariance, np.ones(4), 1.0, parameters.bounds)
    assert separable(parameters, posterior)
    said = verdict(NAMES, posterior.of(parameters.stiffness), posterior.of(parameters.shares))
    assert "prostate left: mu1 is 19 to 31 % of mu1 + mu2 (95 %)" in said
    assert "prostate right: mu1 and mu2 cannot be told apart" in said
    left, right = parameter_facts(NAMES, parameters, posterior).values()
    assert left.mu1_mu2_separable and not right.mu1_mu2_separable
    # mu1 = share G / 2: relative spreads of 12 and 10 % add up to 16 %.
    np.testing.assert_allclose(np.log(np.array(left.mu1_ci95_kpa) / 5.0), [-0.32, 0.29], atol=0.03)
