"""The blind check's own rules: what is sealed stays sealed, and the scores say what happened."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phantoms import write_case

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.core.errors import ConvergenceError, InputError
from palpate.simulate.walls import BladderSpec, RectumSpec
from palpate.ui.cli import main as cli
from palpate.validate.blind import study as gap_study
from palpate.validate.blind.achieved import achieved
from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import (
    BEST_NOISE_MM,
    NOISE_MM,
    StudyOptions,
    another,
    instead,
    recipes_of,
)
from palpate.validate.blind.scores import scores
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE
from palpate.validate.blind.simulator.strength import Hopeless, TooWeak

STIFFNESS = {"prostate_left": {"G_kpa": 21.0, "sd_ln_G": 0.2}, "prostate_right": {"G_kpa": 90.0, "sd_ln_G": 0.1}}


def truth(*effects: str, library: bool = True) -> dict[str, Any]:
    true_G = {"prostate_left": 20.0, "prostate_right": 50.0}
    return {"name": "x", "effects": list(effects) or ["none"], "sizes": {}, "in_library": library, "true_G_kpa": true_G}


def found(verdict: str, *candidates: str) -> dict[str, Any]:
    ranking = [{"effect": "inclusion", "probability": 0.7}, {"effect": "prestress", "probability": 0.3}]
    return {"verdict": verdict, "candidates": list(candidates), "ranking": ranking, "gap": {"p_value": 0.01},
            "stiffness": {"without_effect": STIFFNESS, "with_effect": None},
            "shrinkage": {"noise_corrected_fraction": 0.7, "ci95": [0.4, 0.9]},
            "where": {"map": "diagnose/gap_maps.npz", "peak_lps_mm": [1.0, 2.0, 3.0]}}  # fmt: skip


def test_scores_count_what_they_say() -> None:
    pairs = [
        (truth("inclusion") | {"instead_of": ["gravity_change"]}, found("inclusion", "inclusion")),
        (truth("prestress"), found("ambiguous", "inclusion", "prestress")),
        (truth("prestress"), None),
        (truth(), found("none")),
        (truth(), found("inclusion", "inclusion")),
        (truth("uneven_growth", library=False), found("unknown")),
        (truth("inclusion", "prestress"), found("ambiguous", "prestress")),
    ]
    s = scores(pairs)
    assert s["top1"] == pytest.approx(1 / 3)
    assert s["in_candidates"] == pytest.approx(2 / 3)
    assert (s["failed"], s["false_alarms"], s["refused_outside"], s["one_of_two"]) == (1, 0.5, 1.0, 1.0)
    assert s["brier"] == pytest.approx((2 * 0.3**2 + 2 * 0.7**2) / 2)
    assert s["baseline_commonest"] == pytest.approx(2 / 3)
    assert s["stiffness_95_without"] == 0.5
    assert s["stiffness_95_with"] is None
    assert s["gave_place"] == {"gravity_change": 1}
    assert s["confusion"]["prestress"] == {"ambiguous": 1, "failed": 1}


def test_effect_free_cases_say_whether_p_values_are_uniform_and_the_stiffness_right() -> None:
    """Halves of 21 and 90 kPa where 20 and 50 are true, with 0.2 and 0.1 of ln G."""
    even = [found("none") | {"gap": {"p_value": p}} for p in (np.arange(40) + 0.5) / 40]
    small = [found("none") | {"gap": {"p_value": p**2}} for p in (np.arange(40) + 0.5) / 40]
    hidden = (truth("inclusion"), found("inclusion", "inclusion"))
    s = scores([*((truth(), f) for f in even), hidden, (truth(), None)])["nothing_hidden"]
    z = np.log(np.array([21.0 / 20.0, 90.0 / 50.0])) / (0.2, 0.1)
    assert (s["cases"], s["p_median"], s["ln_G_95"]) == (40, pytest.approx(0.5), 0.5)
    assert (s["ln_G_mean"], s["ln_G_rms"]) == (pytest.approx(z.mean()), pytest.approx(np.sqrt(np.mean(z**2))))
    assert s["p_uniform"] > 0.99
    assert scores([(truth(), f) for f in small])["nothing_hidden"]["p_uniform"] < 0.05
    assert scores([hidden, (truth(), None)])["nothing_hidden"] is None


def test_places_and_biases_are_scored_where_there_are_any() -> None:
    better = {name: s | {"G_kpa": truth()["true_G_kpa"][name] * 1.01} for name, s in STIFFNESS.items()}
    helped = found("inclusion", "inclusion")
    helped["stiffness"] = {"without_effect": STIFFNESS, "with_effect": better}
    s = scores([(truth("inclusion") | {"centre_mm": [1.0, 2.0, 7.0]}, helped), (truth("prestress"), found("none"))])
    assert s["location_error_mm"] == pytest.approx(4.0)
    before = [np.log(s["G_kpa"] / truth()["true_G_kpa"][name]) for name, s in STIFFNESS.items()]
    error = s["ln_G_error"]  # of two cases; nothing was found in the second, whose error stays
    assert error is not None
    assert (error["halves"], error["without"]) == (4, pytest.approx(np.sqrt(np.mean(np.square(before)))))
    assert error["with"] == pytest.approx(np.sqrt(np.mean(np.square([*before, np.log(1.01), np.log(1.01)]))))
    assert s["stiffness_bias_ratio"] == pytest.approx((np.log(1.01) / 0.1) / (np.log(90.0 / 50.0) / 0.1))
    assert scores([(truth(), found("none"))])["location_error_mm"] is None


def test_shrinkage_is_held_against_what_the_true_effect_achieves() -> None:
    pairs = [
        (truth("inclusion") | {"achieved": (0.8, 0.5, 0.1)}, found("inclusion", "inclusion")),
        (truth("prestress") | {"achieved": (0.2, 0.5, 0.4)}, found("ambiguous", "prestress")),
        (truth("prestress") | {"achieved": (0.2, 0.5, 0.4)}, found("none")),
        (truth("prestress"), found("prestress", "prestress")),
    ]
    assert scores(pairs)["shrinkage"] == {"cases": 2, "error": pytest.approx(0.3), "ci95_covers": 0.5}


def test_accuracy_of_effects_that_can_be_seen_is_counted_apart() -> None:
    seen, hidden = ({"effect_mm": mm, "effect_left_mm": 0.5 * mm, "noise_mm": 0.35} for mm in (0.9, 0.2))
    pairs = [(truth("inclusion") | seen, found("inclusion", "inclusion")), (truth("prestress") | hidden, found("none"))]
    large = scores(pairs)["large"]
    assert large["twice_noise"] == {"cases": 1, "top1": 1.0, "in_candidates": 1.0}
    assert (
        large["twice_floor"]["cases"] == 0
    )  # 0.9 mm is less than twice what two contours of 0.35 mm and the rest add up to
    assert large["identifiable"]["cases"] == 1


def test_refusals_of_effects_that_can_be_seen_are_counted_apart() -> None:
    sizes = (0.9, 0.55, 0.2)  # the noise floor is 0.52
    seen, hardly, hidden = ({**truth("tissue_tear", library=False), "noise_mm": 0.3, "effect_mm": mm} for mm in sizes)
    s = scores([(seen, found("ambiguous", "inclusion")), (hardly, found("none")), (hidden, found("none"))])
    assert s["large_outside"]["twice_noise"] == {"cases": 1, "refused": 1.0}
    assert s["large_outside"]["floor"] == {"cases": 2, "refused": 0.5}
    assert s["refused_outside"] == pytest.approx(1.0 / 3.0)


def test_what_an_effect_achieves_is_measured_to_the_surface_without_noise() -> None:
    """A flat organ that moved up by 1 mm, drawn 0.4 mm too far out at rest: predicted 2 mm off, 0.5 mm with the effect."""
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-20.0, 20.0, 21), np.linspace(-20.0, 20.0, 21)))
    corners, faces = np.array([[-90.0, -90.0, 0.0], [90.0, -90.0, 0.0], [0.0, 120.0, 0.0]]), np.array([[0, 1, 2]])
    up = np.array([0.0, 0.0, 1.0])
    at = np.stack([x, y, np.full(len(x), 0.4)], axis=1)
    voxels = 0.3 * (-1.0) ** np.arange(len(x))  # too fine for a model to be blamed for
    maps = {
        "points": at, "predicted/plain": at + (2.6 + voxels[:, None]) * up, "predicted/inclusion": at,
        "correction/plain": np.full(len(x), 0.4), "correction/inclusion": np.full(len(x), 0.5),
        "offset/plain": np.zeros(1), "offset/inclusion": np.zeros(1),
    }  # fmt: skip
    true = {"points": corners + up, "at_rest": corners, "faces": faces}
    assert achieved(maps, true, "inclusion") == pytest.approx((0.75, 2.0, 0.5), rel=0.03)
    maps["offset/inclusion"] = np.full(1, 0.4)
    assert achieved(maps, true, "inclusion") == pytest.approx((0.95, 2.0, 0.1), rel=0.03)
    assert achieved(maps, true, "prestress") is None


def test_what_an_effect_achieves_is_over_all_states_that_were_diagnosed() -> None:
    """A flat organ that moved up by 1 mm, and by 3 mm in the second state; predicted 2 and 1 mm off, 0.5 and 0.1 mm with the effect."""
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-20.0, 20.0, 21), np.linspace(-20.0, 20.0, 21)))
    corners, faces = np.array([[-90.0, -90.0, 0.0], [90.0, -90.0, 0.0], [0.0, 120.0, 0.0]]), np.array([[0, 1, 2]])
    up, at = np.array([0.0, 0.0, 1.0]), np.stack([x, y, np.zeros(len(x))], axis=1)
    true = {"points": corners + up, "at_rest": corners, "faces": faces, "points_2": corners + 3.0 * up}
    maps = {
        "points": at, "predicted/plain": at + 3.0 * up, "predicted/inclusion": at + 1.5 * up,
        "correction/plain": np.zeros(len(x)), "correction/inclusion": np.zeros(len(x)),
        "offset/plain": np.zeros(1), "offset/inclusion": np.zeros(1),
    }  # fmt: skip
    first = achieved(maps, true, "inclusion")
    assert first == achieved(maps, {name: true[name] for name in ("points", "at_rest", "faces")}, "inclusion")
    assert first == pytest.approx((0.75, 2.0, 0.5), rel=0.03)
    maps |= {f"state_2/{name}": value for name, value in maps.items()}
    maps |= {"state_2/predicted/plain": at + 3.6 * up, "state_2/predicted/inclusion": at + 2.9 * up}
    maps |= {f"state_2/correction/{name}": np.full(len(x), 0.4) for name in ("plain", "inclusion")}
    maps |= {"state_2/offset/inclusion": np.full(1, -0.2)}
    rms = [np.sqrt((2.0**2 + 1.0**2) / 2.0), np.sqrt((0.5**2 + 0.1**2) / 2.0)]
    assert achieved(maps, true, "inclusion") == pytest.approx((1.0 - rms[1] / rms[0], *rms), rel=0.03)
    del maps["state_2/predicted/inclusion"]
    assert achieved(maps, true, "inclusion") == first


def test_recipes_have_the_mixture_asked_for_and_are_the_same_every_time() -> None:
    recipes = recipes_of(StudyOptions(60, 3))
    assert recipes == recipes_of(StudyOptions(60, 3))
    assert sum(not r.effects for r in recipes) == 12
    assert sum(any(e in OUTSIDE for e in r.effects) for r in recipes) == 12
    assert sum(len(r.effects) == 2 for r in recipes) == 6
    assert {e for r in recipes for e in r.effects} == {*LIBRARY, *OUTSIDE}
    wanted = [r.shown_mm / noise_floor_mm(r.noise_mm) for r in recipes if r.shown_mm is not None]
    assert len(wanted) == 60
    assert 1.0 <= min(wanted) < 1.3
    assert 5.0 < max(wanted) <= 6.0
    noise = [r.noise_mm for r in recipes]
    assert NOISE_MM[0] <= min(noise) < 0.25 < 0.7 < max(noise) <= NOISE_MM[1]
    assert {r.least_noise_mm for r in recipes} == {BEST_NOISE_MM}
    assert len({r.noise for r in recipes}) == 60  # no two contours err by the same law, none as the diagnosis has it
    assert 10 < sum(r.stated_over_true is None for r in recipes) < 32
    assert len({r.voxel_mm for r in recipes}) > 55
    assert min(r.voxel_mm[0] for r in recipes) >= 0.8
    assert 2.0 < max(r.voxel_mm[2] for r in recipes) <= 3.0
    assert all(r.free_edge for r in recipes if "gravity_change" in r.effects)


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study whose cases and diagnoses take no time: the child sees a folder and writes what a diagnosis would."""

    def made(recipe: Recipe, case: Path, answers: Path, meshes: Path) -> None:
        write_case(case)
        answers.mkdir(parents=True, exist_ok=True)
        (answers / f"{recipe.name}.json").write_text(json.dumps(truth(*recipe.effects) | {"name": recipe.name}))

    def diagnosed(case: Path, timeout_s: float) -> None:
        ledger = json.loads((tmp_path / "ledger.json").read_text())
        assert case.name in ledger["answers"], "diagnosed before the answers were sealed"
        CaseFolder(case).write_json("diagnosis.json", found("none"))

    monkeypatch.setattr(gap_study, "make_case", made)
    monkeypatch.setattr(gap_study, "_diagnosed", diagnosed)
    return tmp_path


def test_a_case_is_found_from_wherever_the_study_was_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--folder` is relative by default, and the process that diagnoses begins in the case."""
    case = tmp_path / "study" / "cases" / "gap_000"
    case.mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    gap_study._diagnosed(case.relative_to(tmp_path), 120.0)
    said = (case / "diagnose.log").read_text()
    assert "is no folder" not in said
    assert "case.json" in said or "labels" in said, said


def test_answers_are_sealed_before_and_unchanged_after(study: Path) -> None:
    result = gap_study.run(study, StudyOptions(3, 1))
    ledger = json.loads((study / "ledger.json").read_text())
    for k in range(3):
        name = f"gap_{k:03d}"
        assert ledger["answers"][name] == file_sha256(study / "answers" / f"{name}.json")
        assert ledger["diagnoses"][name] == file_sha256(study / "cases" / name / "diagnosis.json")
    assert result["cases"] == 3
    assert np.isfinite(result["false_alarms"])


def test_an_answer_that_was_touched_ends_the_study(study: Path) -> None:
    gap_study.run(study, StudyOptions(2, 1))
    (study / "answers" / "gap_001.json").write_text(json.dumps(truth("prestress")))
    with pytest.raises(InputError, match="seals other answers"):
        gap_study.run(study, StudyOptions(2, 1))


def test_a_study_keeps_its_number_of_states(study: Path) -> None:
    assert gap_study.run(study, StudyOptions(2, 1, states=2))["states"] == 2
    assert json.loads((study / "ledger.json").read_text())["states"] == 2
    assert gap_study.run(study, StudyOptions(2, 1, states=2))["cases"] == 2
    with pytest.raises(InputError, match=r"was made with --states 2; give that, .* with --states 1"):
        gap_study.run(study, StudyOptions(2, 1))


def test_an_effect_free_study_hides_nothing_and_mixes_with_no_other(study: Path) -> None:
    alone = StudyOptions(4, 1, effect_free=True)
    result = gap_study.run(study, alone)
    assert (result["cases"], result["nothing_hidden"]["cases"]) == (4, 4)
    assert result["confusion"] == {"none": {"none": 4}}
    made = sorted(p.name for p in (study / "cases").iterdir())
    with pytest.raises(InputError, match=r"was made with --states 1 --effect-free; give that, .* with --states 1$"):
        gap_study.run(study, StudyOptions(4, 1))
    assert sorted(p.name for p in (study / "cases").iterdir()) == made
    assert gap_study.run(study, alone)["cases"] == 4


def test_effect_free_recipes_are_those_of_the_whole_study() -> None:
    assert recipes_of(StudyOptions(4, 3, effect_free=True)) == [
        r for r in recipes_of(StudyOptions(20, 3)) if not r.effects
    ]


def test_a_study_from_before_there_were_states_has_one(study: Path) -> None:
    gap_study.run(study, StudyOptions(2, 1))
    ledger = json.loads((study / "ledger.json").read_text())
    del ledger["states"]
    for left in (json.dumps(ledger), None):  # all diagnosed; stopped before the answers were sealed
        (study / "ledger.json").unlink() if left is None else (study / "ledger.json").write_text(left)
        with pytest.raises(InputError, match="was made with --states 1"):
            gap_study.run(study, StudyOptions(2, 1, states=2))
        assert gap_study.run(study, StudyOptions(2, 1))["cases"] == 2


def test_the_command_asks_for_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked: list[StudyOptions] = []
    monkeypatch.setattr(gap_study, "run", lambda folder, options, progress: asked.append(options) or {})
    given = ["validate", "gap", "--folder", str(tmp_path), "--quiet"]
    assert cli.main([*given, "--states", "2"]) == cli.main(given) == 0
    assert cli.main([*given, "--effect-free"]) == 0
    assert [(options.states, options.effect_free) for options in asked] == [(2, False), (1, False), (1, True)]
    capfd.readouterr()
    assert cli.main([*given, "--states", "0"]) == 2
    assert "--states: 0 is out of range; give 1 to 9" in capfd.readouterr().err


def test_a_case_folder_never_holds_its_answer(study: Path) -> None:
    gap_study.run(study, StudyOptions(2, 1))
    for path in (study / "cases").rglob("*"):
        if path.is_file() and path.suffix == ".json" and path.name != "diagnosis.json":
            assert "effects" not in path.read_text()


def test_a_patient_without_an_equilibrium_is_made_easier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Recipe] = []

    def make(recipe: Recipe, case: Path, answers: Path, meshes: Path) -> None:
        tried.append(recipe)
        case.mkdir()
        if len(tried) < 3:
            raise ConvergenceError("folds")

    monkeypatch.setattr(gap_study, "make_case", make)
    (tmp_path / "cases").mkdir()
    rectum, bladder = RectumSpec(10.0, push_mm=(0.0, -5.0, 0.0)), BladderSpec(push_mm=(0.0, 0.0, 2.0))
    gap_study._made(Recipe("gap_000", 1, {"inclusion": 0.0}, shown_mm=0.7, rectum=rectum, bladder=bladder), tmp_path)
    assert [r.rectum.inflate_mm for r in tried] == pytest.approx([10.0, 10.0 * 0.85**2, 10.0 * 0.85**4])
    assert [r.rectum.push_mm[1] for r in tried] == pytest.approx([-5.0, -5.0 * 0.85**2, -5.0 * 0.85**4])
    assert [r.bladder.push_mm[2] for r in tried] == pytest.approx([2.0, 2.0 * 0.85**2, 2.0 * 0.85**4])
    assert (tmp_path / "cases" / "gap_000").is_dir()


@pytest.mark.parametrize(("why", "patients"), [(TooWeak, 4), (Hopeless, 1)])
def test_an_effect_that_no_patient_shows_gives_its_place_to_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: type[TooWeak], patients: int
) -> None:
    tried: list[Recipe] = []

    def make(recipe: Recipe, case: Path, answers: Path, meshes: Path) -> None:
        tried.append(recipe)
        if len({tuple(r.effects) for r in tried}) < 3:
            raise why("0.1 mm are left")
        case.mkdir()

    monkeypatch.setattr(gap_study, "make_case", make)
    (tmp_path / "cases").mkdir()
    first = recipes_of(StudyOptions(2, 5))[1]
    gap_study._made(first, tmp_path)
    assert len({r.seed for r in tried}) == len(tried) == 2 * patients + 1
    assert [r.instead_of for r in tried] == [()] * patients + [tuple(first.effects)] * (patients + 1)
    assert all(set(r.effects) <= set(LIBRARY) for r in tried)
    assert (tmp_path / "cases" / "gap_001").is_dir()


def test_the_next_patient_shows_more_of_an_effect_and_of_none_no_more() -> None:
    first = recipes_of(StudyOptions(2, 5))[1]
    second = another(first)
    third = another(second)
    assert [r.attempt for r in (first, second, third)] == [0, 1, 2]
    assert all(r.build < 4 and r.effects == first.effects for r in (second, third))
    plain = recipes_of(StudyOptions(1, 5))[0]
    assert not plain.effects
    assert another(plain).attempt == 0


def test_every_effect_has_a_row() -> None:
    shown = {"effect_left_mm": 2.0 * noise_floor_mm(0.3), "noise_mm": 0.3, "achieved": (0.8, 0.5, 0.1)}
    pairs = [
        (truth("inclusion") | shown, found("inclusion", "inclusion")),
        (truth("inclusion") | shown, found("none")),
        (truth("prestress") | shown | {"instead_of": ["gravity_change"]}, found("ambiguous", "inclusion", "prestress")),
        (truth("organ_twist", library=False) | shown, None),
        (truth("inclusion", "prestress") | shown, found("unknown")),
        (truth(), found("none")),
    ]
    rows = scores(pairs)["by_effect"]
    assert list(rows) == ["gravity_change", "inclusion", "prestress", "organ_twist"]
    focus = rows["inclusion"]
    assert (focus["cases"], focus["alone"], focus["in_candidates"], focus["answered_none"]) == (2, 0.5, 0.5, 0.5)
    assert (focus["first"], focus["shown_floors"], focus["shrinkage_ci95_covers"]) == (1.0, pytest.approx(2.0), 1.0)
    assert (rows["prestress"]["first"], rows["prestress"]["in_candidates"], rows["prestress"]["refused"]) == (
        0.0,
        1.0,
        1.0,
    )
    assert rows["gravity_change"] | {"cases": 0, "gave_place": 1} == rows["gravity_change"]
    assert (rows["organ_twist"]["in_library"], rows["organ_twist"]["refused"]) == (False, 0.0)


def test_another_effect_is_of_the_same_kind_and_number() -> None:
    for recipe in recipes_of(StudyOptions(20, 3)):
        other = instead(recipe)
        assert len(other.effects) == len(recipe.effects)
        assert not set(other.effects) & set(recipe.effects)
        for kind in (LIBRARY, OUTSIDE):
            assert (set(other.effects) <= set(kind)) == (set(recipe.effects) <= set(kind))
        assert other.seed != recipe.seed
        if recipe.effects:
            assert instead(another(other)).instead_of == tuple(recipe.effects)


def test_of_patients_the_first_who_shows_the_effect_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Recipe] = []

    def make(recipe: Recipe, case: Path, answers: Path, meshes: Path) -> None:
        tried.append(recipe)
        if len(tried) < 2:
            raise TooWeak("0.1 mm are left")
        case.mkdir()

    monkeypatch.setattr(gap_study, "make_case", make)
    (tmp_path / "cases").mkdir()
    gap_study._made(recipes_of(StudyOptions(2, 5))[1], tmp_path)
    assert len(tried) == 2
    assert len({tuple(r.effects) for r in tried}) == 1
    assert (tmp_path / "cases" / "gap_001").is_dir()


def test_a_patient_without_any_equilibrium_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def make(recipe: Recipe, case: Path, answers: Path, meshes: Path) -> None:
        tried.append(recipe.seed)
        if len(set(tried)) < 3:
            raise ConvergenceError("folds")
        case.mkdir()

    monkeypatch.setattr(gap_study, "make_case", make)
    (tmp_path / "cases").mkdir()
    gap_study._made(recipes_of(StudyOptions(1, 5))[0], tmp_path)
    assert len(set(tried)) == 3
    assert (tmp_path / "cases" / "gap_000").is_dir()
