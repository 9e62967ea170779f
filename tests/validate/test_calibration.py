"""Simulation-based calibration: an exact posterior passes, a too narrow or displaced one is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from phantoms import write_case

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.labels import BONE
from palpate.imaging.volume import Volume
from palpate.simulate.source import labels_on
from palpate.ui.cli import main as cli
from palpate.validate.calibration import study
from palpate.validate.calibration.posterior import CutNormal, posteriors_of
from palpate.validate.calibration.ranks import calibration, rank, uniformity
from palpate.validate.calibration.records import CalibrationOptions
from palpate.validate.calibration.study import Estimator, calibration_text, run
from palpate.validate.simulated.contour_noise import ContourErrors, ContourNoise, Scan
from palpate.validate.simulated.random_fields import Part, correlation, random_vectors

BOUNDS = (5.0, 500.0)
LOW, HIGH = np.log(BOUNDS)


def pairs(count: int, narrower: float = 1.0, off: float = 0.0) -> list[tuple[CutNormal, float, int]]:
    """ln G drawn from the prior, seen with an error of 0.3 to 1: under a flat prior the cut normal about what is seen is exact."""
    rng = np.random.default_rng(4)
    out = []
    for _ in range(count):
        truth, sd = rng.uniform(LOW, HIGH), rng.uniform(0.3, 1.0)
        posterior = CutNormal(truth + sd * rng.standard_normal() + off, sd / narrower, LOW, HIGH)
        out.append((posterior, float(truth), rank(posterior, float(truth), rng)))
    return out


def test_an_exact_posterior_has_uniform_ranks_and_intervals_that_hold() -> None:
    found = calibration(pairs(600))
    assert found["chi_square_p"] is not None
    assert found["chi_square_p"] > 0.05
    assert len(found["ranks"]) == 20
    for row in found["intervals"]:
        assert row["low"] <= row["level"] <= row["high"]
    assert abs(found["z_mean"]) < 3.0 * found["z_mean_error"]
    assert abs(found["z_rms"] - 1.0) < 3.0 * found["z_rms_error"]


@pytest.mark.parametrize(("narrower", "off"), [(1.6, 0.0), (0.6, 0.0), (1.0, 0.3)], ids=["narrow", "wide", "displaced"])
def test_a_wrong_posterior_is_found(narrower: float, off: float) -> None:
    found = calibration(pairs(300, narrower, off))
    assert found["chi_square_p"] is not None
    assert found["chi_square_p"] < 0.01
    held = {row["level"]: row for row in found["intervals"]}
    if narrower > 1.0:
        assert held[0.95]["high"] < 0.95
        assert found["z_rms"] > 1.2
    if narrower < 1.0:
        assert held[0.5]["low"] > 0.5
    if off:
        assert found["z_mean"] < -4.0 * found["z_mean_error"]


def test_few_cases_have_few_bins_and_too_few_have_no_p() -> None:
    counts, p = uniformity(np.arange(0, 100, 4))
    assert counts.tolist() == [5, 5, 5, 5, 5]
    assert p == pytest.approx(1.0)
    assert uniformity(np.array([3, 50, 99]))[1] is None


def test_a_normal_cut_at_its_bound_has_its_interval_within() -> None:
    cut = CutNormal(LOW - 1.0, 0.5, LOW, HIGH)
    low, high = cut.interval(0.95)
    assert LOW <= low < high < LOW + 1.5
    assert cut.z(low) == pytest.approx(-1.96, abs=0.01)


def _made(options: CalibrationOptions, number: int, folder: Path) -> bool:
    """A case that takes no time; every seventh patient has no equilibrium."""
    name = f"patient_{number:04d}"
    if number % 7 == 6:
        return False
    if not (folder / "answers" / f"{name}.json").exists():
        write_case(folder / "cases" / name)
        G = np.exp(np.random.default_rng(number).uniform(LOW, HIGH, 2)).tolist()
        truth = {"name": name, "effects": ["none"], "true_G_kpa": dict(zip(("left", "right"), G, strict=True))}
        (folder / "answers").mkdir(exist_ok=True)
        (folder / "answers" / f"{name}.json").write_text(json.dumps(truth))
    return True


def estimator(narrower: float, analysed: list[str]) -> Estimator:
    """Posteriors of a stand-in that knows the truth up to a normal error of 0.4; it fails for patient 0."""

    def analyse(case: Path, timeout_s: float) -> None:
        ledger = json.loads((case.parents[1] / "ledger.json").read_text())
        assert case.name in ledger["answers"], "analysed before the answers were sealed"
        analysed.append(case.name)
        if case.name != "patient_0000":
            CaseFolder(case).write_json("posterior.json", {})

    def posteriors(case: Path, result: str) -> dict[str, CutNormal]:
        number = int(case.name.rsplit("_", 1)[1])
        truth = np.random.default_rng(number).uniform(LOW, HIGH, 2)
        seen = truth + 0.4 * np.random.default_rng([number, 1]).standard_normal(2)
        return {
            name: CutNormal(float(at), 0.4 / narrower, LOW, HIGH)
            for name, at in zip(("left", "right"), seen, strict=True)
        }

    return Estimator("posterior.json", analyse, posteriors)


def test_a_study_is_sealed_goes_on_and_tells_exact_from_narrow(tmp_path: Path) -> None:
    options, analysed = CalibrationOptions(70, bounds_kpa=BOUNDS), list[str]()
    found = run(tmp_path, options, estimator=estimator(1.0, analysed), make=_made)
    assert (found["failed"], found["short"]) == (1, 10)
    assert found["one_region"] is not None
    assert found["one_region"]["cases"] == found["by_region"]["left"]["cases"] == 59
    assert found["one_region"]["chi_square_p"] > 0.05  # type: ignore[operator]
    assert "chi-square p" in calibration_text(found)
    assert len(analysed) == 60
    narrow = run(tmp_path, options, estimator=estimator(4.0, analysed), make=_made)
    assert analysed[60:] == ["patient_0000"]  # the only one without a result
    assert narrow["one_region"]["chi_square_p"] < 0.01  # type: ignore[index, operator]
    with pytest.raises(InputError, match=r"was made with --simulator blind --seed 1 .* with --simulator phantom"):
        run(tmp_path, CalibrationOptions(70, simulator="phantom"), estimator=estimator(1.0, []), make=_made)
    (tmp_path / "answers" / "patient_0001.json").write_text("{}")
    with pytest.raises(InputError, match="seals other answers"):
        run(tmp_path, options, estimator=estimator(1.0, []), make=_made)


@pytest.mark.parametrize(
    ("simulator", "effect", "why"),
    [("x", None, "no simulator 'x'"), ("blind", "x", "no effect 'x'"), ("phantom", "inclusion", "hides nothing")],
)
def test_what_is_not_there_is_refused(tmp_path: Path, simulator: str, effect: str | None, why: str) -> None:
    with pytest.raises(InputError, match=why):
        run(tmp_path, CalibrationOptions(2, simulator=simulator, effect=effect))


def test_the_program_s_own_files_are_read(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "c", CaseFacts("c", organ_shear_modulus_bounds_kpa=(2.0, 80.0)))
    plain, with_effect = ({"prostate_left": {"G_kpa": G, "sd_ln_G": sd}} for G, sd in ((20.0, 0.2), (30.0, 0.5)))
    case.write_json("result.json", {"parameters": plain})
    case.write_json("diagnosis.json", {"stiffness": {"without_effect": plain, "with_effect": None}})
    expected = CutNormal(float(np.log(20.0)), 0.2, float(np.log(2.0)), float(np.log(80.0)))
    for name in ("result.json", "diagnosis.json"):
        assert posteriors_of(case.path, name) == {"prostate_left": expected}
    case.write_json("diagnosis.json", {"stiffness": {"without_effect": plain, "with_effect": with_effect}})
    assert posteriors_of(case.path, "diagnosis.json")["prostate_left"].sd == 0.5
    case.write_json("diagnosis.json", {"stiffness": {"without_effect": None}})
    with pytest.raises(InputError, match="contains no stiffness"):
        posteriors_of(case.path, "diagnosis.json")


def test_the_command_asks_for_simulator_effect_and_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked: list[CalibrationOptions] = []

    def calibrate(folder: Path, options: CalibrationOptions, progress: object) -> object:
        asked.append(options)
        return run(folder, options, estimator=estimator(1.0, []), make=_made)

    monkeypatch.setattr(study, "run", calibrate)
    given = ["validate", "calibration", "--folder", str(tmp_path), "--cases", "2", "--quiet"]
    assert cli.main([*given, "--effect", "inclusion", "--bounds", "6", "60"]) == 0
    assert (asked[0].effect, asked[0].bounds_kpa, asked[0].simulator) == ("inclusion", (6.0, 60.0), "blind")
    capfd.readouterr()
    assert cli.main([*given, "--bounds", "60", "6"]) == 2
    assert "give two rising numbers" in capfd.readouterr().err


@pytest.mark.parametrize("freedom", [None, 5.0])
def test_a_random_field_has_the_covariance_asked_for(freedom: float | None) -> None:
    parts = (Part(0.6, "gaussian", 3.0), Part(0.4, "matern32", 8.0))
    rng = np.random.default_rng(0)
    box = np.zeros(3), np.full(3, 40.0)
    points = rng.uniform(0.0, 40.0, (1500, 3))
    across, along = points + [4.0, 0.0, 0.0], points + [0.0, 0.0, 2.0]
    values = []
    for _ in range(6):
        field = random_vectors(parts, box, rng, axial=0.5, freedom=freedom)
        values.append([field(p) for p in (points, across, along)])
    here, there, above = (np.concatenate([v[k].ravel() for v in values]) for k in range(3))
    # Linear interpolation of the field's grid takes a little of the variance of its finest part.
    assert np.mean(here**2) == pytest.approx(1.0, abs=0.15)
    expected = float(correlation(parts, np.array([4.0]))[0])
    assert np.corrcoef(here, there)[0, 1] == pytest.approx(expected, abs=0.1)
    assert np.corrcoef(here, above)[0, 1] == pytest.approx(expected, abs=0.1)  # half as long along z
    if freedom is not None:
        assert np.mean(here**4) / np.mean(here**2) ** 2 > 3.8


RADIUS = 12.0


def ball(points: np.ndarray) -> np.ndarray:
    return np.where((points**2).sum(axis=1) < RADIUS**2, 1, 3).astype(np.uint8)


def test_errors_that_scans_have_in_common_go_along_with_the_tissue() -> None:
    shift = np.array([4.0, 0.0, 0.0])
    affine = np.diag([3.0, 3.0, 3.0, 1.0])
    affine[:3, 3] = -21.0
    grid = Volume(np.zeros((16, 15, 15), dtype=np.uint8), affine)
    scans = {"rest": Scan(ball), "deformed": Scan(lambda p: ball(p - shift), lambda p: p - shift)}
    noise = ContourNoise(0.5, (Part(1.0, "gaussian", 6.0),), common=1.0)
    errors = ContourErrors.of(noise, scans, grid, np.random.default_rng(1))
    points = np.random.default_rng(2).normal(size=(50, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1, keepdims=True)
    rest, deformed = (errors.fields[state, "organ"] for state in ("rest", "deformed"))
    np.testing.assert_allclose(rest(points), deformed(points + shift), atol=1e-9)
    own = ContourErrors.of(ContourNoise.plain(0.5, 6.0), scans, grid, np.random.default_rng(1))
    assert np.abs(own.fields["rest", "organ"](points) - own.fields["deformed", "organ"](points + shift)).max() > 0.2


def test_bones_have_errors_of_their_own_and_the_edge_of_the_region_has_none() -> None:
    """A bar of bone through a region in whose middle an organ lies; it ends at the region's edge on both sides."""
    affine = np.eye(4)
    affine[:3, 3] = -20.0
    grid = Volume(np.zeros((41, 41, 41), dtype=np.uint8), affine)
    coarse = Volume(np.zeros((14, 14, 14), dtype=np.uint8), affine @ np.diag([3.0, 3.0, 3.0, 1.0]))

    def pelvis(points: np.ndarray) -> np.ndarray:
        bar = np.abs(points[:, 1:] - [-14.0, 0.0]).max(axis=1) < 4.2
        return np.where((np.abs(points) < 18.2).all(axis=1), np.where(bar, BONE, ball(points)), 0).astype(np.uint8)

    clean = labels_on(pelvis, grid).array
    noise = ContourNoise(0.8, (Part(1.0, "gaussian", 6.0),), bone_ratio=1.0)
    drawn = {}
    for name, law in {"bones": noise, "none": replace(noise, bone_ratio=0.0)}.items():
        errors = ContourErrors.of(law, {"rest": Scan(pelvis)}, coarse, np.random.default_rng(1))
        drawn[name] = errors.on("rest", pelvis, grid).array
    assert np.array_equal(drawn["none"] == BONE, clean == BONE)
    moved = (drawn["bones"] == BONE) != (clean == BONE)
    assert 0.02 < moved.sum() / (clean == BONE).sum() < 0.4
    assert all(np.array_equal(found == 0, clean == 0) for found in drawn.values())
    # Below the edge the bar's inside is bone still, although labels of beyond the region were asked for there.
    inside = (np.abs(grid.to_lps(np.argwhere(clean == BONE).astype(float))[:, 1:] - [-14.0, 0.0]) < 1.5).all(axis=1)
    assert (drawn["bones"][clean == BONE][inside] == BONE).all()
