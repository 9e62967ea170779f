"""What a diagnosis hands from step to step."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from palpate.core.diagnose import diagnose as module
from palpate.core.diagnose.options import DiagnosisOptions

OPTIONS = DiagnosisOptions()
EFFECTS: Any = {"a": "an effect"}


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[Any, ...]]:
    """Every step gives its own name, and notes what it was given."""
    given: dict[str, tuple[Any, ...]] = {}

    def step(name: str) -> Any:
        def called(*arguments: Any) -> Any:
            given[name] = arguments
            return SimpleNamespace(free="fields") if name == "around" else name

        return called

    for name in ("fit_plain", "screen", "free_field", "compared", "discrepancy_maps", "judge", "with_stiffness"):
        monkeypatch.setattr(module, name, step(name))
    monkeypatch.setattr(module, "UnknownDiscrepancy", SimpleNamespace(around=step("around")))
    monkeypatch.setattr(module, "_surroundings", step("surroundings"))
    monkeypatch.setattr(module, "with_own_element_errors", step("improved"))
    return given


@pytest.mark.parametrize("known", [True, False])
def test_each_step_is_given_what_the_ones_before_found(known: bool, steps: dict[str, tuple[Any, ...]]) -> None:
    data: Any = SimpleNamespace(pairs="pairs", remeshed="meshes")
    fit: Any = SimpleNamespace(
        linearisation="at", model=SimpleNamespace(data_vectors="data"), options=OPTIONS.noise_model
    )
    told: list[float] = []
    if not known:
        found_anew, module.fit_plain = module.fit_plain, lambda *a: (found_anew(*a), fit)[1]  # type: ignore[misc]
    found: Any = module.diagnose(data, EFFECTS, lambda f, m: told.append(f), 7, OPTIONS, fit if known else None)
    assert found == "with_stiffness"
    assert ("fit_plain" in steps) != known
    if not known:
        pairs, meshes, _, noise, walls = steps["fit_plain"]
        assert (pairs, meshes, noise, walls) == ("pairs", "meshes", OPTIONS.noise_model, OPTIONS.wall_motion)
    assert steps["around"] == ("at", "data", OPTIONS.noise_model)
    assert steps["surroundings"] == (data, fit)
    assert steps["screen"] == (fit, EFFECTS, "surroundings")
    assert steps["free_field"] == ("fields", OPTIONS.noise_model.gap_sizes)
    of, looked_at, unnamed, rules, seed, _, improve = steps["compared"]
    assert (of, looked_at, unnamed, rules, seed) == (fit, "screen", "free_field", OPTIONS.decision_rules, 7)
    progress: Any = object()
    assert improve("screened", "refits", progress) == "improved"
    assert steps["improved"] == (fit, "screened", "refits", OPTIONS.decision_rules, progress)
    forces = steps["discrepancy_maps"][1]
    assert steps["discrepancy_maps"] == (fit, forces, OPTIONS.decision_rules) and forces.free == "fields"
    assert steps["judge"] == (fit, "compared", "discrepancy_maps", forces, OPTIONS.decision_rules, 7)
    assert steps["with_stiffness"][0] == "judge"
    assert told == sorted(told)
