"""A pair that deforms nothing: the same scan twice, and the whole body moved. The posterior is the prior, and that is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case
from scipy.spatial.transform import Rotation

from palpate.core.files.json_types import plain
from palpate.core.identify.job import run
from palpate.core.identify.pair.rigid_pair import rigid_pair
from palpate.core.identify.predicted_posterior import predict
from palpate.core.inference.posterior import verdict
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

Points = np.ndarray
TURN = Rotation.from_rotvec(np.radians(9.0) * np.array([0.6, 0.64, -0.48]))
SHIFT = np.array([14.0, -9.0, 6.0])


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    return synthetic_case.problem(fine=4, coarse=3)


def seen_as(problem: IdentificationProblem, moved: Callable[[Points], Points]) -> IdentificationProblem:
    """The pair whose second scan shows every surface at rest, moved."""

    def again(pair: SurfacePair) -> SurfacePair:
        rest = pair.rest
        return SurfacePair(rest, Surface(moved(rest.points), rest.faces, rest.region))

    walls = {name: again(pair) for name, pair in problem.walls.items()}
    return replace(problem, walls=walls, organ=again(problem.organ))


def identified(problem: IdentificationProblem, folder: Path) -> dict[str, Any]:
    np.savez(folder / "problem.npz", **problem.arrays())
    options = {"element": "p1p1", "method": "gauss-newton"}
    job = Job("palpate.core.identify.job:run", str(folder), {"problem": str(folder / "problem.npz")}, options, seed=3)
    return plain(run(job, Reporter(lambda message: None)))


@pytest.mark.parametrize(
    ("moved", "words"),
    [
        (lambda x: x, "by its contours, the second scan shows the same as the first"),
        (
            lambda x: TURN.apply(x) + SHIFT,
            "by its contours, the second scan may show the first one moved as a whole, by",
        ),
    ],
    ids=["the same scan twice", "moved rigidly"],
)
def test_nothing_can_be_identified_and_that_is_said(
    problem: IdentificationProblem, tmp_path: Path, moved: Callable[[Points], Points], words: str
) -> None:
    result = identified(seen_as(problem, moved), tmp_path)
    assert result["identifiability"]["verdict"].startswith(
        "nothing can be identified: the deformation this pair shows is too"
    )
    assert result["notes"][0].startswith(words)
    assert result["misfit"]["rms_mm"] < 0.02
    low, high = problem.facts.bounds_kpa
    for values in result["parameters"].values():
        # 95 % of what was allowed, and no more told than that.
        assert values["ci95_kpa"][0] < 1.15 * low and values["ci95_kpa"][1] > high / 1.15
        assert not values["at_bound"]
    assert (tmp_path / "fields.npz").is_file()


def test_the_motion_is_found_through_redrawn_contours(problem: IdentificationProblem) -> None:
    rng = np.random.default_rng(5)

    def redrawn(x: Points) -> Points:
        knots = rng.uniform(-15.0, 15.0, (60, 3))
        smooth = np.exp(-0.5 * ((x[:, None] - knots) ** 2).sum(axis=2) / 5.0**2) @ rng.standard_normal((60, 3))
        return TURN.apply(x + 0.05 * smooth) + SHIFT

    found = rigid_pair(seen_as(problem, redrawn))
    assert found.nothing_deformed
    centre = problem.organ.rest.points.mean(axis=0)
    assert found.shift_mm == pytest.approx(np.linalg.norm(TURN.apply(centre) + SHIFT - centre), abs=0.1)


def test_a_squeezed_ball_is_no_rigid_motion(problem: IdentificationProblem) -> None:
    found = rigid_pair(problem)
    assert not found.nothing_deformed
    assert found.left_mm["organ"] > 3.0 * found.expected_mm["organ"]


def test_landmarks_that_moved_within_the_organ_speak_against_it(problem: IdentificationProblem) -> None:
    still = seen_as(problem, lambda x: x)
    marks = np.array([[3.0, 1.0, 2.0], [-4.0, 2.0, 0.0], [0.0, -3.0, 4.0]])
    assert rigid_pair(replace(still, landmarks=np.hstack([marks, marks]))).nothing_deformed
    assert not rigid_pair(replace(still, landmarks=np.hstack([marks, marks + [0.0, 2.0, -1.0]]))).nothing_deformed


def test_a_deformation_far_below_the_contours_error_tells_nothing_either(problem: IdentificationProblem) -> None:
    """Solved for, not recognised: the walls moved, by a tenth of the noise, and the spread is that of the prior."""
    facts = replace(problem.facts, noise_sd_mm=2.0, noise_correlation_mm=12.0)
    weak = replace(problem, facts=facts, walls={n: _partly(p, 0.05) for n, p in problem.walls.items()})
    posterior = predict(weak, np.log([30.0, 70.0]), element="p1p1").posterior
    assert posterior is not None
    assert verdict(("prostate_left", "prostate_right"), posterior).startswith("nothing can be identified")


def _partly(pair: SurfacePair, share: float) -> SurfacePair:
    rest, deformed = pair.rest, pair.deformed
    return SurfacePair(rest, replace(deformed, points=rest.points + share * (deformed.points - rest.points)))
