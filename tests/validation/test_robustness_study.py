"""Random scenes and particles in short; 10,000 of them: `palpate validate robustness --scenes 10000`."""

from __future__ import annotations

import numpy as np

from palpate.core.validate.random_scenes import ELEMENT_SHARES, random_scene
from palpate.core.validate.robustness import RobustnessOptions, robustness


def test_random_particles_end_in_a_stable_equilibrium_or_a_reason() -> None:
    found = robustness(RobustnessOptions(n=120, seed=20_000))
    assert found["not_finite"] == 0 and found["raised"] == 0 and found["hanging"] == 0
    assert found["failed_without_reason"] == 0
    assert found["share_converged"] >= 119 / 120, found["failures"]  # type: ignore[operator]


def test_the_scenes_are_as_wide_as_they_claim() -> None:
    scenes = [random_scene(seed) for seed in range(60)]
    described = [s.description for s in scenes]
    assert {d["element"] for d in described} == set(ELEMENT_SHARES)
    assert {d["load"] for d in described} == {"strained", "pressed", "pulled", "dented"}
    assert {d["start"] for d in described} == {"rest", "smooth", "inverted", "not finite"}
    assert min(float(d["G_kpa_low"]) for d in described) < 7.0
    assert max(float(d["G_kpa_high"]) for d in described) > 400.0
    assert all(78 <= int(d["cells"]) <= 600 for d in described)
    turned = [s.scene.assembler for s in scenes if s.description["start"] == "inverted"]
    starts = [s.start for s in scenes if s.description["start"] == "inverted"]
    for assembler, start in zip(turned, starts, strict=True):
        F = assembler.deformation_gradients(start)  # type: ignore[arg-type]
        assert np.linalg.det(F).min() < 0.0


def test_a_seed_is_a_scene() -> None:
    first, second = random_scene(3), random_scene(3)
    assert first.description == second.description
    np.testing.assert_array_equal(first.scene.space.nodes, second.scene.space.nodes)
