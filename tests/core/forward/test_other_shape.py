"""An assembler on another rest shape is the one that would be built there."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.fem.scenes import sphere_materials, sphere_scene
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.forward.scene_parts import on_other_shape
from palpate.core.mesh import TetMesh


@pytest.mark.parametrize("element", ["p2p1", "p1p1", "p2p0", "p2"])
def test_it_has_the_energy_residual_and_tangent_of_a_new_one(element: str) -> None:
    scene = sphere_scene(sphere_in_cube(2, 1, 1), element)
    first, mesh, rng = scene.assembler, scene.space.mesh, np.random.default_rng(4)
    first.set_materials(scene.materials)
    bent = mesh.points + 0.05 * mesh.points[:, [1, 2, 0]] ** 2 / np.abs(mesh.points).max()
    space = Space.of(TetMesh(bent, mesh.cells, mesh.regions), element)
    moved, new = on_other_shape(first, space), Assembler(space, first.free, first.terms)
    new.set_materials(scene.materials)
    moved.set_materials(sphere_materials(50.0))  # nothing of these stays behind
    moved.set_materials(scene.materials)
    state = State(rng.normal(size=(space.n_nodes, 3)) * 0.01, rng.normal(size=space.n_pressures))
    assert moved.energy(state.u, 1.0) == new.energy(state.u, 1.0)
    np.testing.assert_array_equal(moved.tangent(state, 1.0)[0], new.tangent(state, 1.0)[0])
    for name in ("r_u", "r_p", "scale"):
        np.testing.assert_array_equal(
            getattr(moved.residual(state, 1.0), name), getattr(new.residual(state, 1.0), name)
        )
    # The first one is as it was.
    p = rng.normal(size=space.n_pressures)
    again = Assembler(scene.space, first.free, first.terms)
    again.set_materials(scene.materials)
    np.testing.assert_array_equal(first.pressures.apply(p), again.pressures.apply(p))
    np.testing.assert_array_equal(first.pressures.solve(p), again.pressures.solve(p))
