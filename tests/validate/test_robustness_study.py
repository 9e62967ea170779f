"""Random scenes and particles in short; 10,000 of them: `palpate validate robustness --scenes 10000`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from palpate.validate.forward.random_scenes import ELEMENT_SHARES, random_scene
from palpate.validate.forward.robustness import RobustnessOptions, append_rows, read_rows, robustness


@pytest.mark.nightly
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


def test_a_study_that_was_stopped_goes_on_where_it_was(tmp_path: Path) -> None:
    log = tmp_path / "rows.jsonl"
    robustness(RobustnessOptions(n=3, seed=40, log=log))
    with log.open("a") as stream:
        stream.write('{"seed": 43, "conv')  # killed while writing
    before = log.read_text()
    told: list[str] = []
    found = robustness(RobustnessOptions(n=5, seed=40, log=log), lambda _, message: told.append(message))
    assert found["scenes"] == 5 and found["share_converged"] == 1.0
    assert log.read_text().startswith(before + "\n")
    added = [json.loads(line) for line in log.read_text()[len(before) + 1 :].splitlines()]
    assert [row["seed"] for row in added] == [43, 44]
    assert told == ["5 scenes, 0 without equilibrium"]


def test_outcomes_of_other_code_are_not_taken_over(tmp_path: Path) -> None:
    log = tmp_path / "rows.jsonl"
    row = {"seed": 7, "converged": False, "finite": True, "raised": False, "reason": "old"}
    append_rows(log, [row], "another code")
    assert read_rows(log, "this code") == {}
    assert read_rows(log, "another code") == {7: row}
    assert robustness(RobustnessOptions(n=1, seed=7, log=log))["share_converged"] == 1.0


def test_workers_change_no_outcome(tmp_path: Path) -> None:
    alone, together = (robustness(RobustnessOptions(n=4, seed=60, workers=w)) for w in (1, 2))
    timed = {"seconds_total", "seconds_longest"}
    assert {k: v for k, v in alone.items() if k not in timed} == {k: v for k, v in together.items() if k not in timed}
