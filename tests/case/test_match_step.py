"""The match step: nothing without both CTs, the start that the model predicts, and the file that it leaves."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from diagnoses import diagnosis
from phantoms import result
from synthetic_case import HALF, problem, push

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.matched import FILE, read_matched_motion, wants_image
from palpate.case.steps import diagnose, identify, match
from palpate.case.steps.declarations import DIAGNOSE
from palpate.case.steps.diagnose import DiagnoseOptions
from palpate.core.errors import InputError
from palpate.core.matched_motion import MatchedMotion


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    return CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))


def test_a_case_without_both_scans_is_not_matched(case: CaseFolder) -> None:
    case.file("rest_ct").mkdir()
    assert match.run(case) is None
    assert read_matched_motion(case) is None and not case.has(FILE)


def test_images_are_used_where_both_scans_are_there_and_not_where_somebody_leaves_them_out(case: CaseFolder) -> None:
    case.file("rest_ct").mkdir()
    assert not wants_image(case, None)
    case.file("deformed_ct").mkdir()
    assert wants_image(case, None)
    assert not wants_image(case, False)


def test_a_diagnosis_stands_on_what_the_stiffness_stands_on(case: CaseFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[CaseFolder] = []
    monkeypatch.setattr(match, "run", lambda case, progress: asked.append(case))
    case.write_json("mesh.json", {})
    for state in STATES:
        case.file(f"{state}_ct").mkdir()
    for options, count in ((None, 1), ({"image": False}, 1), ({"image": True}, 2)):
        if options is not None:
            case.write_json("result.json", result() | {"options": options})
        with pytest.raises(InputError):  # there is nothing to diagnose
            diagnose.run(case)
        assert len(asked) == count


def test_scans_that_do_not_show_the_same_are_left_out_and_the_result_says_so(
    case: CaseFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = np.zeros((0, 3))
    alike = {"now": 0.75}

    def matched(case: CaseFolder, progress: object = None) -> MatchedMotion:
        return MatchedMotion(nothing, nothing, np.zeros((0, 3, 3)), 10.0, alike=alike["now"])

    for step in (identify, diagnose):
        monkeypatch.setattr(step.match, "run", matched)
        monkeypatch.setattr(step, "missing_structures", lambda *_: [])
    asked: list[bool] = []
    monkeypatch.setattr(identify, "_write_problems", lambda case, folder, options: asked.append(bool(options.image)))
    monkeypatch.setattr(identify, "_job", lambda case, options, paths: options)
    monkeypatch.setattr(
        diagnose, "data_of", lambda case, image, law: asked.append(image) or diagnose.Remeshed(None, None)
    )
    monkeypatch.setattr(diagnose, "remeshed", lambda *_: None)
    monkeypatch.setattr(diagnose, "replace", lambda data, **_: data)
    monkeypatch.setattr(diagnose, "arrays", lambda data: {})
    monkeypatch.setattr(diagnose, "rigid_offset_notes", lambda case: [])
    for name in ("mesh.json", "mesh.npz", "surfaces.npz"):
        case.write_text(name, "{}")
    for state in STATES:
        case.file(f"{state}_ct").mkdir()

    def answer(options: object, hear: object) -> dict[str, object]:
        found = {k: v for k, v in result().items() if k not in ("versions", "inputs_sha256")}
        return found | {"options": asdict(options)}  # type: ignore[call-overload]

    found = identify.run(case, do_job=answer)  # type: ignore[arg-type]
    assert found.missing[0].startswith("two CTs that show the same tissue") and "0.75" in found.missing[0]
    assert asked == [False] and found.options.image is False  # type: ignore[union-attr]
    said = diagnose.run(case, DiagnoseOptions(image=True), do_job=lambda *_: diagnosis("none"))
    assert said.flags[0] == found.missing[0] and said.image is False
    alike["now"] = 0.97
    again = identify.run(case, do_job=answer)  # type: ignore[arg-type]
    assert asked[-1] and not again.missing and again.options.image is True  # type: ignore[union-attr]


def test_the_file_holds_the_motion_and_is_an_input_of_the_diagnosis(case: CaseFolder) -> None:
    points = np.arange(6.0).reshape(2, 3)
    case.write_npz(FILE, **MatchedMotion(points, points + 1.0, np.tile(np.eye(3), (2, 1, 1)), 10.0).arrays())
    again = read_matched_motion(case)
    assert again is not None
    np.testing.assert_array_equal(again.moved, points + 1.0)
    assert again.correlation_mm == 10.0 and again.is_of_one_body
    case.write_npz(FILE, **MatchedMotion(points, points, np.tile(np.eye(3), (2, 1, 1)), 10.0, alike=0.4).arrays())
    other = read_matched_motion(case)
    assert other is not None and not other.is_of_one_body
    assert FILE in DIAGNOSE.inputs(case)


def test_a_file_that_lacks_an_array_is_named(case: CaseFolder) -> None:
    case.write_npz(FILE, points=np.zeros((0, 3)))
    with pytest.raises(InputError, match=f"{FILE} lacks"):
        read_matched_motion(case)


def test_matching_starts_from_the_motion_that_the_model_predicts() -> None:
    depth = 3.0
    posed = problem(depth=depth)
    predicted, nodes = match.predicted_motion(posed), posed.mesh.points
    front, back = nodes[nodes[:, 1] > HALF - 1e-6], nodes[nodes[:, 1] < 1e-6 - HALF]
    np.testing.assert_allclose(predicted(front)[:, 1], -push(front[:, 0], front[:, 2], depth), atol=0.1)
    assert np.abs(predicted(back)).max() < 0.01
    assert np.isfinite(predicted(np.full((1, 3), 200.0))).all()
