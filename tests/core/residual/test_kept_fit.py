"""The plain fit that `identify` keeps: a diagnosis from it is the one without it, and no other fit is taken for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_case import matched, problem

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict.record import maps, record
from palpate.core.files.json_types import plain
from palpate.core.identify.identify import identify
from palpate.core.identify.options import IdentifyOptions
from palpate.core.inference.grid_posterior import GridPosterior
from palpate.core.inference.posterior import Posterior
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.residual import fit_file
from palpate.core.residual.case_data import CaseData, arrays_of_state
from palpate.core.residual.fit_file import FILE, FitQuestion, fit_of
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.kept_fit import _posterior, arrays_of
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import FoundFit, PlainFit
from palpate.core.worker.messages import Reporter

EFFECTS = {k: v for k, v in library().items() if k in ("contour_bias", "tissue_stiffening")}
NOISE, WALLS = NoiseModelOptions(), WallMotionOptions()


@pytest.fixture(scope="module")
def posed() -> IdentificationProblem:
    return problem(depth=5.0)


@pytest.fixture(scope="module")
def identified(posed: IdentificationProblem, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FoundFit]:
    """Folder of an identification, with the fit that it keeps, and that fit."""
    folder = tmp_path_factory.mktemp("identify")
    np.savez(folder / "problem.npz", **arrays_of_state(posed, None))
    options = IdentifyOptions(method="gauss-newton", stiffness_map=False)
    return folder, identify(folder, [folder / "problem.npz"], options, "a job", Reporter(lambda message: None)).fit


def no_fit(question: FitQuestion, progress: object = None) -> PlainFit:
    raise AssertionError("the model was fitted")


def kept(posed: IdentificationProblem, file: Path) -> tuple[PlainFit, list[str]]:
    return fit_of(CaseData(posed), NOISE, WALLS, [file])


def test_a_diagnosis_from_the_kept_fit_is_the_one_that_fits_anew(
    posed: IdentificationProblem, identified: tuple[Path, FoundFit], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    anew, told = kept(posed, tmp_path / FILE)
    monkeypatch.setattr(FitQuestion, "fit", no_fit)
    found, notes = kept(posed, identified[0] / FILE)
    assert told == notes == []
    one, other = (diagnose(CaseData(posed), EFFECTS, fit=fit) for fit in (anew, found))
    assert plain(record(one, "a case")) == plain(record(other, "a case"))
    here, there = maps(one), maps(other)
    assert here.keys() == there.keys()
    for name in here:
        np.testing.assert_array_equal(here[name], there[name])


def test_a_restored_fit_is_the_fit(
    posed: IdentificationProblem, identified: tuple[Path, FoundFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FitQuestion, "fit", no_fit)
    before, after = identified[1], kept(posed, identified[0] / FILE)[0]
    first, second = arrays_of(before), arrays_of(after)
    assert first.keys() == second.keys()
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)
    # What is not kept but made again: the data vector where the body is, and the tangent there.
    was, now = before.linearisation.first, after.linearisation.first
    data, again = before.model.first.data, after.model.first.data
    assert data.n == again.n
    np.testing.assert_array_equal(
        data.residual(was.scene, was.equilibrium.u), again.residual(now.scene, now.equilibrium.u)
    )
    b = np.random.default_rng(1).normal(size=(len(was.scene.assembler.kept), 2))
    np.testing.assert_array_equal(was.tangent.solve(b), now.tangent.solve(b))


def test_a_fit_to_images_is_restored_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = replace(problem(), matched=matched())
    np.savez(tmp_path / "problem.npz", **arrays_of_state(seen, None))
    options = IdentifyOptions(method="gauss-newton", stiffness_map=False)
    before = identify(tmp_path, [tmp_path / "problem.npz"], options, "a job", Reporter(lambda message: None)).fit
    monkeypatch.setattr(FitQuestion, "fit", no_fit)
    after, notes = kept(seen, tmp_path / FILE)
    assert notes == []
    assert after.sizes == before.sizes and len(after.sizes.image.local) > 1
    np.testing.assert_array_equal(after.weighting.covariance, before.weighting.covariance)


def shifted(posed: IdentificationProblem) -> IdentificationProblem:
    points = posed.organ.deformed.points.copy()
    points[0, 0] = np.nextafter(points[0, 0], np.inf)
    return replace(posed, organ=replace(posed.organ, deformed=replace(posed.organ.deformed, points=points)))


def test_whatever_decides_the_fit_is_in_its_key(posed: IdentificationProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    other = FitQuestion(pairs=[(shifted(posed), None)])
    softer = replace(posed, facts=replace(posed.facts, tissue_shear_modulus_kpa=21.0))
    questions = [
        FitQuestion(pairs=[(posed, None)]),
        other,
        FitQuestion(pairs=[(softer, None)]),
        FitQuestion(pairs=[(posed, posed.organ)]),
        FitQuestion(pairs=[(posed, None), (posed, None)]),
        FitQuestion(pairs=[(posed, None)], noise=NoiseModelOptions(own_mm=0.31)),
        FitQuestion(pairs=[(posed, None)], walls=WallMotionOptions(smooth_mm=5.0)),
        FitQuestion(pairs=[(posed, None)], how=FitOptions(element="p1p1")),
        FitQuestion(pairs=[(posed, None)], further="uneven"),
    ]
    keys = [question.key() for question in questions]
    assert len(set(keys)) == len(keys)
    assert questions[0].key() == keys[0]
    monkeypatch.setattr(fit_file, "_version", lambda package: "another")
    assert questions[0].key() not in keys


def test_the_fit_of_another_input_is_not_taken(
    posed: IdentificationProblem, identified: tuple[Path, FoundFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FitQuestion, "fit", no_fit)
    with pytest.raises(AssertionError, match="was fitted"):
        kept(shifted(posed), identified[0] / FILE)


@pytest.mark.parametrize("damage", ["cut", "noise", "flipped", "empty", "short"])
def test_a_damaged_file_is_said_and_the_model_fitted_again(
    damage: str,
    posed: IdentificationProblem,
    identified: tuple[Path, FoundFit],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(FitQuestion, "fit", lambda question, progress: identified[1])
    whole = (identified[0] / FILE).read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    path = tmp_path / FILE
    content = {"cut": whole[: len(whole) // 2], "noise": b"no archive" * 99, "flipped": bytes(flipped), "empty": b""}
    if damage == "short":  # the right key, an array missing
        with np.load(identified[0] / FILE, allow_pickle=False) as data:
            np.savez(path, **{name: data[name] for name in data.files if name != "theta"})
    else:
        path.write_bytes(content[damage])
    found, notes = kept(posed, path)
    assert len(notes) == 1 and "\n" not in notes[0]
    assert notes[0].startswith(f"{tmp_path.name}/{FILE} cannot be read: ")
    assert notes[0].endswith("the plain model was fitted again")
    np.testing.assert_array_equal(found.linearisation.residual, identified[1].linearisation.residual)
    monkeypatch.setattr(FitQuestion, "fit", no_fit)
    assert kept(posed, path)[1] == []  # the file is whole again


@pytest.mark.parametrize("on_grid", [True, False])
def test_either_form_of_a_posterior_is_kept(on_grid: bool) -> None:
    rng, bounds = np.random.default_rng(1), np.log([[5.0, 500.0], [5.0, 500.0]])
    half = rng.standard_normal((2, 2))
    parts = (np.log([20.0, 60.0]), half @ half.T, np.array([3.0, 2.0]), 1.7, bounds)
    grid = (np.cumsum(rng.random((2, 5)), axis=1), np.cumsum(rng.random((2, 5)), axis=1))
    kept = GridPosterior(*parts, *grid) if on_grid else Posterior(*parts)
    fields = [name for name in vars(kept) if name != "scale"]
    found = _posterior({f"posterior/{name}": getattr(kept, name) for name in fields}, kept.scale)
    assert type(found) is type(kept) and found.scale == 1.7
    for name in fields:
        np.testing.assert_array_equal(getattr(found, name), getattr(kept, name))
