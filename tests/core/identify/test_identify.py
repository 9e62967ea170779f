"""Identification against known stiffness, data from a finer mesh and another element."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case

from palpate.core.diagnose.verdict.model_average import plain_stiffness
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.identify.job import run
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.reidentify import identify_again
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.inference.grid_posterior import GridPosterior
from palpate.core.inference.posterior import verdict
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.plain_fit import PlainFit, fit_plain
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

TRUTH = (30.0, 70.0)


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    return synthetic_case.problem(TRUTH)


@pytest.fixture(scope="module")
def job_result(problem: IdentificationProblem, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("identify")
    return _run(problem, folder, {"element": "p1p1", "iterations": 25, "starts": 2})


def _run(problem: IdentificationProblem, folder: Path, options: dict[str, Any]) -> dict[str, Any]:
    np.savez(folder / "problem.npz", **problem.arrays())
    job = Job("palpate.core.identify.job:run", str(folder), {"problem": str(folder / "problem.npz")}, options, seed=3)
    return plain(run(job, Reporter(lambda message: None)))


def test_taylor_hood_finds_both_stiffnesses_within_five_percent(problem: IdentificationProblem) -> None:
    fit = fit_plain([(problem, None)], how=FitOptions(element="p2p1", starts=1))
    np.testing.assert_allclose(np.exp(fit.linearisation.theta), TRUTH, rtol=0.05)
    low, high = fit.posterior.interval().T
    assert (low < TRUTH).all() and (high > TRUTH).all()


@pytest.fixture(scope="module")
def quick_fit(problem: IdentificationProblem) -> PlainFit:
    return fit_plain([(problem, None)], how=FitOptions(element="p1p1", starts=1))


def test_misfit_jacobian_is_the_derivative_of_the_misfit(quick_fit: PlainFit) -> None:
    misfit, here = Misfit.of(quick_fit), quick_fit.linearisation.first
    none = np.zeros(quick_fit.model.n)
    scene, theta, u = here.scene, here.theta, here.equilibrium.u
    points = scene.observation.all_points
    slopes = np.stack([points @ s for s in scene.displacement_sensitivities(theta, here.equilibrium)])
    J = misfit.jacobian([points @ u], [slopes])
    h = 1e-3
    for k in range(2):
        step = h * np.eye(2)[k]
        ahead, behind = (misfit.residual([points @ scene.solve(theta + s, u).u], none) for s in (step, -step))
        np.testing.assert_allclose((ahead - behind) / (2 * h), J[:, k], atol=2e-4 * np.abs(J).max())


def test_the_misfit_at_the_fit_is_the_fits_own(quick_fit: PlainFit) -> None:
    here = quick_fit.linearisation.first
    moved = here.scene.observation.all_points @ here.equilibrium.u
    correction = quick_fit.model.correction.at(here.theta)
    np.testing.assert_allclose(Misfit.of(quick_fit).residual([moved], correction), quick_fit.residual, atol=1e-10)


def test_identification_and_diagnosis_give_one_number(
    problem: IdentificationProblem, job_result: dict[str, Any]
) -> None:
    """To the last digit: `diagnose` fits the plain model as `identify` does."""
    fit = fit_plain([(problem, None)], how=FitOptions(element="p1p1", starts=2))
    theta, covariance = plain_stiffness(fit)
    assert isinstance(fit.posterior, GridPosterior)
    for k, values in enumerate(job_result["parameters"].values()):
        assert values["G_kpa"] == np.exp(theta)[k]
        assert values["sd_ln_G"] == np.sqrt(covariance[k, k])
        assert list(values["ci95_kpa"]) == fit.posterior.interval()[k].tolist()
        assert np.allclose(np.array(values["quantiles_kpa"])[[0, -1]], values["ci95_kpa"], rtol=1e-12)


def test_walls_end_on_the_deformed_surface(problem: IdentificationProblem) -> None:
    scene = plain_scene(problem, "p1p1")
    settled = scene.settle(np.log(TRUTH))
    assert settled.equilibrium.converged
    gaps = scene.walls[0].gaps(settled.equilibrium.u)
    assert np.abs(gaps).max() < 0.1
    assert np.abs(scene.walls[0].points.displacements(settled.equilibrium.u)[:, 1]).max() > 4.0


def test_the_same_scan_twice_moves_nothing_and_tells_nothing(problem: IdentificationProblem) -> None:
    still = replace(
        problem,
        walls={k: replace(v, deformed=v.rest) for k, v in problem.walls.items()},
        organ=replace(problem.organ, deformed=problem.organ.rest),
    )
    fit = fit_plain([(still, None)], how=FitOptions(element="p1p1", starts=1))
    assert np.abs(fit.linearisation.first.equilibrium.u).max() < 0.02
    posterior = fit.posterior
    assert "not identifiable" in verdict(("prostate_left", "prostate_right"), posterior)


def test_swarm_and_gauss_newton_name_the_same_optimum(job_result: dict[str, Any]) -> None:
    assert job_result["agreement"]["same_optimum"]
    assert job_result["method"] == "swarm"
    assert (
        set(job_result["agreement"]["swarm_G_kpa"])
        == set(job_result["agreement"]["difference_sd"])
        == set(job_result["parameters"])
    )
    # The data are without noise: less is left than noise would leave on average.
    assert 0.0 < job_result["misfit"]["weighted"] < job_result["misfit"]["weighted_from_noise"]
    assert job_result["parameters"]["prostate_right"]["G_kpa"] > job_result["parameters"]["prostate_left"]["G_kpa"]
    assert job_result["misfit"]["rms_mm"] < 0.2 * job_result["misfit"]["rms_before_mm"]


def test_a_redrawn_contour_is_identified_again_without_a_solve(
    problem: IdentificationProblem, tmp_path: Path, job_result: dict[str, Any]
) -> None:
    options = {"element": "p1p1", "iterations": 4, "starts": 1, "stiffness_map": False}
    _run(problem, tmp_path, options)
    chosen = IdentifyOptions(**options, seed=3)
    same = identify_again(tmp_path, problem, chosen)
    assert same is not None and same.model_error_mm < 0.02
    found = [values["G_kpa"] for values in job_result["parameters"].values()]
    np.testing.assert_allclose(np.exp(same.theta), found, rtol=0.05)
    softer = synthetic_case.problem((20.0, 70.0), fine=4).organ.deformed
    redrawn = identify_again(tmp_path, replace(problem, organ=replace(problem.organ, deformed=softer)), chosen)
    assert redrawn is not None
    assert redrawn.theta[0] < same.theta[0] - 0.15
    other = replace(problem, facts=replace(problem.facts, tissue_shear_modulus_kpa=25.0))
    assert identify_again(tmp_path, other, chosen) is None


def test_parameters_state_every_figure_the_contract_names(job_result: dict[str, Any]) -> None:
    for values in job_result["parameters"].values():
        assert values["G_kpa"] == pytest.approx(2.0 * (values["mu1_kpa"] + values["mu2_kpa"]))
        assert values["ci95_kpa"][0] < values["G_kpa"] < values["ci95_kpa"][1]
        assert not values["at_bound"]


def test_a_rerun_goes_on_from_the_swarm_checkpoint_to_the_same_answer(
    problem: IdentificationProblem, job_result: dict[str, Any], tmp_path: Path
) -> None:
    options = {"element": "p1p1", "iterations": 25, "starts": 2}
    _run(problem, tmp_path, options)
    again = _run(problem, tmp_path, options)
    for key in ("parameters", "misfit", "convergence"):
        assert json.dumps(again[key], default=_plain) == json.dumps(job_result[key], default=_plain)


def _plain(value: Any) -> Any:
    return value.tolist()


def test_gauss_newton_respects_its_bounds() -> None:
    bounds = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    A = np.array([[2.0, 0.3], [0.1, 1.0], [0.5, 0.5]])
    found = gauss_newton(lambda t: (A @ (t - np.array([3.0, -0.6])), A), np.zeros(2), bounds)
    assert found is not None
    assert found.theta[0] == pytest.approx(1.0)
    free = A[:, 1] @ (A @ (found.theta - np.array([3.0, -0.6])))
    assert free == pytest.approx(0.0, abs=1e-2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "genetic"}, "method 'genetic' is unknown; choose one of swarm"),
        ({"element": "q8"}, "element 'q8' is unknown"),
        ({"particles": 0}, "particles = 0 is out of range; give 4 to 1000"),
    ],
)
def test_wrong_options_are_refused_in_one_line(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        IdentifyOptions(**change)


def test_a_problem_without_walls_is_refused(problem: IdentificationProblem) -> None:
    with pytest.raises(InputError, match="nothing drives the organ"):
        plain_scene(replace(problem, walls={}))


def test_a_problem_survives_its_file(problem: IdentificationProblem, tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", **problem.arrays())
    again = IdentificationProblem.load(tmp_path / "p.npz")
    assert again.facts == problem.facts and again.regions == problem.regions
    np.testing.assert_array_equal(again.mesh.cells, problem.mesh.cells)
    np.testing.assert_array_equal(again.organ.deformed.points, problem.organ.deformed.points)
    (tmp_path / "bad.npz").write_text("no")
    with pytest.raises(InputError, match="not a readable identification problem"):
        IdentificationProblem.load(tmp_path / "bad.npz")


def test_regions_that_need_not_be_uniform_are_known_less_surely_and_no_less_truly(
    problem: IdentificationProblem, tmp_path: Path
) -> None:
    options = {"element": "p1p1", "starts": 1, "method": "gauss-newton", "stiffness_map": False}
    (tmp_path / "even").mkdir()
    even = _run(problem, tmp_path / "even", options)
    uneven = _run(problem, tmp_path, {**options, "uneven": True})
    for name, true in zip(("prostate_left", "prostate_right"), TRUTH, strict=True):
        wide, narrow = (r["parameters"][name]["sd_ln_G"] for r in (uneven, even))
        assert 1.05 * narrow < wide < 4.0 * narrow
        low, high = uneven["parameters"][name]["ci95_kpa"]
        assert low < true < high
