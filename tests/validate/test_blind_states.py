"""The blind check's patients with several deformed states: one body, one scan at rest, and what differs from scan to scan."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_case
from synthetic_case import HALF, RADIUS

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import state_labels, state_landmarks
from palpate.case.landmarks import read_landmarks
from palpate.case.problem import state_problems
from palpate.case.stated_files import further_states
from palpate.core.mesh import TetMesh
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshedCase
from palpate.simulate.walls import BladderSpec, RectumSpec
from palpate.validate.blind import cases
from palpate.validate.blind import patient as gap_patient
from palpate.validate.blind.cases import make_case
from palpate.validate.blind.patient import Made
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import StudyOptions, another, easier, recipes_of
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE, OWN_SHARE
from palpate.validate.blind.simulator.patients import Patient
from palpate.validate.blind.simulator.pelvis import Pelvis
from palpate.validate.blind.simulator.visibility import effect_rows, joint_mm

EMPTIED = (RectumSpec(-2.0), BladderSpec())


def test_patients_are_the_same_however_many_states_they_have() -> None:
    one, three = (recipes_of(StudyOptions(20, 3, states=n)) for n in (1, 3))
    assert one == [replace(recipe, more=()) for recipe in three] == recipes_of(StudyOptions(20, 3))
    assert (one[19].seed, another(one[1]).seed) == (329474367, 1153921220)  # from before patients could have several
    assert [r.more[:1] for r in three] == [r.more for r in recipes_of(StudyOptions(20, 3, states=2))]


def test_further_fillings_are_drawn_anew_and_empty_half_of_the_rectums() -> None:
    recipes = recipes_of(StudyOptions(60, 3, states=2))
    second = [recipe.more[0] for recipe in recipes]
    assert len({rectum.inflate_mm for rectum, _ in second} | {r.rectum.inflate_mm for r in recipes}) == 120
    assert 20 < sum(rectum.inflate_mm < 0.0 for rectum, _ in second) < 40
    again = another(recipes[1])
    assert len(again.more) == 1 and again.more != recipes[1].more
    assert replace(again, more=()) == another(replace(recipes[1], more=()))


def test_every_state_is_made_easier() -> None:
    recipe = recipes_of(StudyOptions(2, 3, states=3))[1]
    less = easier(recipe, 2)
    for (rectum, bladder), (rectum_2, bladder_2) in zip(recipe.more, less.more, strict=True):
        assert rectum_2.inflate_mm == pytest.approx(0.7225 * rectum.inflate_mm)
        np.testing.assert_allclose(rectum_2.push_mm, 0.7225 * np.array(rectum.push_mm))
        np.testing.assert_allclose(bladder_2.push_mm, 0.7225 * np.array(bladder.push_mm))
    assert easier(recipe, 0) == recipe


def test_only_what_is_not_the_body_s_has_shares() -> None:
    assert set(OWN_SHARE) < {*LIBRARY, *OUTSIDE}
    recipe = Recipe("x", 7, {"prestress": 0.4, "bone_motion": 2.0, "inclusion": 3.0}, more=(EMPTIED, EMPTIED))
    first, second = recipe.shares()
    assert set(first) == set(second) == {"bone_motion"}
    assert 0.0 <= first["bone_motion"] != second["bone_motion"] <= 1.0
    assert [first] == replace(recipe, more=(EMPTIED,)).shares()


@dataclass
class Push:
    """The block's face y = HALF moves in by this many mm in its middle."""

    mm: float

    def displacement(self, points: np.ndarray) -> np.ndarray:
        depth = np.exp(-((points[:, 0] / 9.0) ** 2) - (points[:, 2] / 9.0) ** 2)
        return np.column_stack([0.0 * depth, -self.mm * depth, 0.0 * depth])


class Ball:
    """A patient: a ball of two halves in tissue, the rectum beyond y = HALF."""

    source = None

    def grid_of(self, voxel_mm: tuple[float, float, float]) -> Volume:
        affine = np.diag([1.2, 1.2, 1.2, 1.0])
        affine[:3, 3] = -HALF
        return Volume(np.zeros((26, 31, 26), dtype=np.uint8), affine)

    def made(self, points: np.ndarray) -> np.ndarray:
        return points

    def labels(self, points: np.ndarray) -> np.ndarray:
        halves = np.where(points[:, 0] > 0.0, 1, 2)
        inside = (points**2).sum(axis=1) < RADIUS**2
        return np.where(inside, halves, np.where(points[:, 1] > HALF, 6, 3)).astype(np.uint8)


@pytest.fixture(scope="module")
def meshed() -> MeshedCase:
    mesh = synthetic_case.block(2, 1, 1)
    faces, _ = mesh.boundary
    front = (mesh.points[faces][:, :, 1] > HALF - 1e-6).all(axis=1)
    return MeshedCase(mesh, {"rectum": faces[front], "outer": faces[~front]})


@pytest.fixture
def block(meshed: MeshedCase, monkeypatch: pytest.MonkeyPatch) -> TetMesh:
    """In place of a pelvis, whose mesh takes long: a block, pushed in by what the rectum's filling says."""

    def walls(patient: Patient, filling: tuple[RectumSpec, BladderSpec]) -> Mapping[str, Push]:
        return {"rectum": Push(filling[0].inflate_mm)}

    for module in (cases, gap_patient):
        monkeypatch.setattr(module, "carried_walls", walls)
    monkeypatch.setattr(cases, "mesh_labels", lambda *_: meshed)
    monkeypatch.setattr(Pelvis, "model_labels", None)
    monkeypatch.setattr(Patient, "of", lambda *_: Ball())
    return meshed.mesh


def recipe_with(effects: Mapping[str, float], *pushes: float) -> Recipe:
    more = tuple((RectumSpec(mm), BladderSpec()) for mm in pushes)
    return Recipe("ball", 11, effects, noise_mm=0.1, rectum=RectumSpec(4.0), marks=True, more=more)


def made(effects: Mapping[str, float], *pushes: float) -> Made:
    return cases.simulated(recipe_with(effects, *pushes))[1]


def test_a_case_of_two_states_is_written_and_read(block: TetMesh, tmp_path: Path) -> None:
    """The contour is drawn 2 mm too wide in the first state, and a share of that in the second, which is pushed as far."""
    truth = make_case(recipe_with({"contour_bias": 2.0}, 4.0), tmp_path / "case", tmp_path / "answers")
    (shares,) = truth["shares"]
    assert truth["states"] == 2
    assert truth == json.loads((tmp_path / "answers" / "ball.json").read_text())
    assert truth["effect_mm"] == pytest.approx(2.0 * np.sqrt((1.0 + shares["contour_bias"] ** 2) / 2.0))
    with np.load(tmp_path / "answers" / "ball_surface.npz") as surface:
        apart = np.linalg.norm(surface["points"] - surface["points_2"], axis=1)
        np.testing.assert_allclose(apart, 2.0 * (1.0 - shares["contour_bias"]), atol=1e-6)

    case = CaseFolder(tmp_path / "case")
    (state,) = further_states(case)
    assert (state.labels, state.landmarks) == ("deformed_2.nii.gz", "landmarks_2.csv")
    seen, first, rest = state_labels(case, state), case.labels("deformed"), case.labels("rest")
    np.testing.assert_array_equal(seen.affine, rest.affine)
    assert not np.array_equal(seen.array, first.array)
    one, two = read_landmarks(case.file("landmarks.csv")), state_landmarks(case, state)
    assert two is not None
    np.testing.assert_array_equal(one.rest, two.rest)
    assert 0.0 < np.abs(one.deformed - two.deformed).max() < 2.5  # errors of reading alone
    organ = Surface(block.points, block.region_boundary((1, 2))[0], np.ones(1, dtype=np.int64))
    pair = SurfacePair(synthetic_case.wall(0.0), synthetic_case.wall(0.0))
    problem = IdentificationProblem(
        block, {}, {"rectum": pair}, SurfacePair(organ, organ), synthetic_case.FACTS, {1: "a", 2: "b"}
    )
    (second,) = state_problems(case, problem)
    assert len(second.landmarks) == 4
    # The organ was pushed along -y, and lies as far from its centre as its contour is too wide.
    out = np.linalg.norm(second.organ.deformed.points - second.organ.deformed.points.mean(axis=0), axis=1)
    assert out.mean() == pytest.approx(RADIUS + 2.0 * shares["contour_bias"] * np.sign(_offset(shares)), abs=0.6)


def _offset(shares: Mapping[str, float]) -> float:
    """Of the contour, first state: whether it is too wide or too tight."""
    offset = made({"contour_bias": 2.0}).hidden.offset
    assert offset is not None
    return float(offset(np.eye(3))[0])


def test_a_case_of_one_state_says_nothing_of_states(block: TetMesh, tmp_path: Path) -> None:
    truth = make_case(recipe_with({"contour_bias": 2.0}), tmp_path / "case", tmp_path / "answers")
    assert not {"states", "shares"} & set(truth)
    assert "states" not in (tmp_path / "case" / "case.json").read_text()
    with np.load(tmp_path / "answers" / "ball_surface.npz") as surface:
        assert set(surface) == {"points", "at_rest", "faces"}


def test_the_body_is_one_and_what_happens_to_it_has_its_share(block: TetMesh) -> None:
    patient = made({"inclusion": 4.0, "volume_change": 0.1}, 2.0)
    (second,) = patient.more
    np.testing.assert_array_equal(second.hidden.G, patient.hidden.G)
    gained, gained_2 = (s.growth[s.in_organ][0] ** 3 - 1.0 for s in (patient.hidden, second.hidden))
    assert abs(gained) == pytest.approx(0.1)
    assert gained_2 == pytest.approx(second.shares["volume_change"] * gained)


def test_walls_move_on_from_where_they_were_at_rest(block: TetMesh) -> None:
    patient = made({"prestress": 0.3}, -2.0)
    (second,) = patient.more
    filled = patient.hidden.filled["rectum"]
    nodes = np.unique(patient.hidden.body.face_nodes(patient.boundary["rectum"]))
    middle = nodes[np.argmin(np.abs(patient.hidden.body.nodes[nodes][:, [0, 2]]).sum(axis=1))]
    at = [state.u[middle, 1] for state in (patient.rest, patient.deformed, second.deformed)]
    np.testing.assert_allclose(at, [-4.0 * filled, -4.0 * (1.0 + filled), 2.0 - 4.0 * filled], atol=1e-9)


def test_what_shows_of_an_effect_is_over_all_states_with_one_stiffness(block: TetMesh) -> None:
    patient = made({"inclusion": 8.0}, -3.0)
    (second,) = patient.more
    rows = [
        effect_rows(s, patient.plain, patient.boundary, patient.rest, state, near)
        for s, state, near in (
            (patient.hidden, patient.deformed, patient.without), (second.hidden, second.deformed, second.without),
        )
    ]  # fmt: skip
    done, D = rows[0]
    left = done - D @ np.linalg.lstsq(D, done, rcond=None)[0]
    alone = replace(patient, more=())
    assert joint_mm(rows[:1]) == alone.effect_mm == (np.linalg.norm(done), np.linalg.norm(left))
    assert joint_mm([rows[0], rows[0]]) == pytest.approx(alone.effect_mm)
    each = np.array([joint_mm([r]) for r in rows])
    both = np.array(patient.effect_mm)
    assert both[0] == pytest.approx(np.sqrt((each[:, 0] ** 2).mean()))
    # No change of two stiffnesses suits both states as well as one for each.
    assert np.sqrt((each[:, 1] ** 2).mean()) <= both[1] < both[0]


def test_the_search_for_a_strength_looks_at_the_first_state_alone(block: TetMesh) -> None:
    wanted = replace(recipe_with({"contour_bias": 0.0}), shown_mm=1.0)
    one, two = (cases.simulated(replace(wanted, more=more))[0] for more in ((), (EMPTIED,)))
    assert one.effects == two.effects
    assert one.effects["contour_bias"] > 0.0
