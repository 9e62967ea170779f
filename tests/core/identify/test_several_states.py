"""One stiffness from several deformed states, and from landmarks inside the organ: more data, narrower posterior, same truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case

from palpate.core.files.json_types import plain
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.identify.job import run
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import fit_plain
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

TRUTH = {"prostate_left": 30.0, "prostate_right": 70.0}
OPTIONS = {"element": "p1p1", "starts": 1, "method": "gauss-newton", "stiffness_map": False}


@pytest.fixture(scope="module")
def states() -> list[IdentificationProblem]:
    """The same organ pushed a little and pushed much."""
    made = [synthetic_case.problem((30.0, 70.0), depth=depth, fine=2) for depth in (4.0, 6.0)]
    return [replace(p, facts=replace(p.facts, noise_sd_mm=0.2)) for p in made]


def identified(states: Sequence[IdentificationProblem], folder: Path, **options: Any) -> dict[str, Any]:
    paths = {}
    for k, problem in enumerate(states):
        name = "problem" if k == 0 else f"problem_{k + 1}"
        paths[name] = str(folder / f"{name}.npz")
        np.savez(paths[name], **problem.arrays())
    job = Job("palpate.core.identify.job:run", str(folder), paths, OPTIONS | options, seed=2)
    return plain(run(job, Reporter(lambda message: None)))


@pytest.fixture(scope="module")
def alone(states: list[IdentificationProblem], tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    return [identified([state], tmp_path_factory.mktemp("alone")) for state in states]


def spread(result: dict[str, Any]) -> np.ndarray:
    return np.array([found["sd_ln_G"] for found in result["parameters"].values()])


def test_two_states_together_tell_more_than_either_and_hold_the_truth(
    states: list[IdentificationProblem], alone: list[dict[str, Any]], tmp_path: Path
) -> None:
    both = identified(states, tmp_path)
    assert (spread(both) < np.minimum(*map(spread, alone))).all()
    # These contours err less than they state, which two states show better than one.
    assert (spread(both) ** -2.0 > 0.85 * sum(spread(a) ** -2.0 for a in alone)).all()
    for name, found in both["parameters"].items():
        assert found["ci95_kpa"][0] < TRUTH[name] < found["ci95_kpa"][1]
        values = [a["parameters"][name]["G_kpa"] for a in alone]
        assert 0.97 * min(values) < found["G_kpa"] < 1.03 * max(values)
    assert [s["rms_mm"] for s in both["states"]] == pytest.approx([a["misfit"]["rms_mm"] for a in alone], abs=0.03)
    assert "2 deformed states together" in both["notes"][0]


def test_two_looks_at_the_same_noise_tell_more_than_one_and_less_than_their_sum(
    states: list[IdentificationProblem],
) -> None:
    """They have the scan at rest in common, and what the bounds say."""
    noise = NoiseModelOptions(contour_prior=1e-3, size_spread=1e-3, length_spread=1e-3)
    how = FitOptions(starts=1, element="p1p1")
    both, *alone = (
        fit_plain([(state, None) for state in some], options=noise, how=how).posterior.spread ** -2.0
        for some in (states, states[:1], states[1:])
    )
    assert (both > np.maximum(*alone)).all()
    assert (both < sum(alone)).all()


def test_the_swarm_adds_the_states_up_too(states: list[IdentificationProblem], tmp_path: Path) -> None:
    by_swarm = identified(states, tmp_path, method="swarm", iterations=15)
    assert by_swarm["agreement"]["same_optimum"]
    # Contours drawn anew would have to say of which state.
    assert (tmp_path / "reduced_2.npz").exists() and not (tmp_path / "again.npz").exists()


def test_a_landmark_inside_the_organ_counts(
    states: list[IdentificationProblem], alone: list[dict[str, Any]], tmp_path: Path
) -> None:
    problem = states[1]
    scene = plain_scene(problem, "p1p1", walls=synthetic_case.FREE)
    u = scene.settle(np.log(list(TRUTH.values()))).equilibrium.u
    at = np.array([[5.0, 1.0, 2.0], [-5.0, 2.0, -1.0], [0.5, 6.0, 0.0]])
    seen = at + scene.space.interpolation(at, problem.regions) @ u
    with_marks = identified([replace(problem, landmarks=np.hstack([at, seen]))], tmp_path)
    assert spread(with_marks).prod() < spread(alone[1]).prod()
    # Walls are predicted half-way between sliding freely, as they did, and going with what pushes them.
    assert with_marks["misfit"]["landmarks_rms_mm"] < 0.5
    elsewhere = np.hstack([at, seen + np.array([0.0, 1.5, 0.0])])
    pulled = identified([replace(problem, landmarks=elsewhere)], tmp_path)
    assert pulled["misfit"]["landmarks_rms_mm"] > 1.0
    for name in TRUTH:
        assert abs(np.log(pulled["parameters"][name]["G_kpa"] / with_marks["parameters"][name]["G_kpa"])) > 0.05
