"""What is dear to find, and other meshes, come back from the arrays of a file as they were."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic_case import problem

from palpate.core.fem.meshes import box
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.problem import SurfacePair
from palpate.core.residual.known_state import KnownState
from palpate.core.residual.remeshing import Remeshed, all_from, left_by_all, what_is_left

FLOOR = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7])


@pytest.mark.parametrize("bones", [True, False])
def test_a_state_s_surfaces_modes_and_bones_are_kept(bones: bool) -> None:
    posed = problem(depth=3.0)
    rest = replace(
        posed.organ.rest, points=posed.organ.rest.points * [3.0, 4.0, 5.5]
    )  # as large as bones, and round about no axis
    moved = replace(rest, points=rest.points + [0.4, -0.2, 0.3])
    bone = BoneRegistration.of(SurfacePair(rest, moved), np.zeros(3), FLOOR, 12.0) if bones else None
    assert (bone is not None) == bones
    geometry = SharedGeometry.of(posed, "p1p1")
    modes = np.random.default_rng(1).standard_normal((len(geometry.observation.points), 4))
    model: Any = SimpleNamespace(geometry=geometry, data=SimpleNamespace(modes=modes, bone=bone))
    known = KnownState.of(model)
    again = KnownState.from_arrays(known.arrays())
    np.testing.assert_array_equal(again.modes, modes)
    x = posed.organ.rest.points
    for ours, theirs in ((again.geometry.target, known.geometry.target),):
        np.testing.assert_array_equal(ours.value_and_gradient(x)[0], theirs.value_and_gradient(x)[0])
    data = again.data(geometry.observation)
    assert (data.n_modes, data.n_marks) == (4, len(posed.landmarks))
    if bone is None:
        assert again.bone is None and data.n == 4
        return
    assert again.bone is not None and data.n == 10
    for motion in (np.zeros_like, lambda X: np.full_like(X, 0.3)):
        np.testing.assert_array_equal(again.bone.residual(motion), bone.residual(motion))
    np.testing.assert_array_equal(again.bone.floor, np.diag(FLOOR**2))
    assert again.bone.residual_at_rest[:3] == pytest.approx([-0.4, 0.2, -0.3], abs=0.1)


def test_other_meshes_are_kept_in_their_order() -> None:
    meshes = [Remeshed(box((1.0, 1.0, k), (1, 1, k)), {"bone": np.array([[0, 1, 2]]) + k}) for k in (1, 2)]
    arrays = {name: values for k, m in enumerate(meshes) for name, values in m.arrays(f"other/{k}").items()}
    again = all_from(arrays, "other")
    assert len(again) == 2
    for ours, theirs in zip(again, meshes, strict=True):
        np.testing.assert_array_equal(ours.mesh.points, theirs.mesh.points)
        np.testing.assert_array_equal(ours.mesh.cells, theirs.mesh.cells)
        np.testing.assert_array_equal(ours.boundary["bone"], theirs.boundary["bone"])
    assert all_from(arrays, "elsewhere") == ()
    with pytest.raises(KeyError):
        all_from({k: v for k, v in arrays.items() if not k.startswith("other/1/cells")}, "other")


def test_the_mean_of_meshes_errs_by_its_standard_error_and_a_share_of_itself() -> None:
    differences = np.random.default_rng(4).standard_normal((3, 6)) + 2.0
    left = what_is_left(differences, 0.3)
    mean = differences.mean(axis=0)
    covariance = np.cov(differences.T) / 3.0 + 0.09 * np.outer(mean, mean)
    np.testing.assert_allclose(left @ left.T, covariance)
    np.testing.assert_allclose(what_is_left(differences[:1], 0.3)[:, 0], 0.3 * differences[0])
    assert what_is_left(differences[:0], 0.3).shape == (6, 0)


def test_the_better_element_s_own_error_has_one_share_in_all_states() -> None:
    rng = np.random.default_rng(5)
    first, second = rng.standard_normal((2, 3)), rng.standard_normal((1, 4))
    left = left_by_all([first, second], 0.3)
    C = left @ left.T
    both = 0.3 * np.concatenate([first.mean(axis=0), second[0]])
    np.testing.assert_allclose(C[:3, 3:], np.outer(both[:3], both[3:]))
    np.testing.assert_allclose(C[3:, 3:], np.outer(both[3:], both[3:]))
    np.testing.assert_allclose(C[:3, :3], np.outer(both[:3], both[:3]) + np.cov(first.T) / 2.0)
    nothing = left_by_all([first[:0], second], 0.3)
    assert not (nothing @ nothing.T)[:3].any()
