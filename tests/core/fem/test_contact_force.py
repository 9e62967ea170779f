"""The paper's boundary (Eq 9): the tissue's reaction to the organ's true surface motion deforms the organ as in the coupled body."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_case
from scipy.spatial import cKDTree

from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.contact_force import InterfaceMotion, RigidHold, organ_terms, tissue_reaction
from palpate.core.fem.meshes import ORGAN, TISSUE, sphere_in_cube
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.scenes import cap_pull, sphere_materials, sphere_scene
from palpate.core.fem.space import Space
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.identify.identify import identify
from palpate.core.identify.options import IdentifyOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.messages import Reporter

TRUTH = np.log([30.0, 70.0])
ELEMENT = "p1p1"


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    return synthetic_case.problem()


def test_true_interface_motion_gives_back_the_coupled_deformation(problem: IdentificationProblem) -> None:
    coupled = plain_scene(problem, ELEMENT, walls=synthetic_case.FREE)
    u = coupled.settle(TRUTH).equilibrium.u
    scene = ContactForceScene(SharedGeometry.of(problem, ELEMENT), u)
    found = scene.solve(TRUTH)
    assert found.converged and found.stable
    expected = coupled.observation.operator @ u
    error = scene.observation.operator @ found.u - expected
    assert np.linalg.norm(error) < 0.03 * np.linalg.norm(expected)


def test_force_and_hold_balance_the_coupled_body_node_by_node() -> None:
    """A pulled ball in linear tissue: organ alone under the pull and the tissue's reaction moves as in the coupled solve."""
    mesh = sphere_in_cube(2, 1, 2)
    coupled = sphere_scene(mesh, "p2p1", 50.0)
    whole = coupled.solve(NewtonOptions(rtol=1e-11))
    assert whole.converged
    (tissue, tissue_of), (organ, organ_of) = (
        (Space.of(part, "p2p1"), cKDTree(coupled.space.nodes))
        for part in (mesh.submesh((TISSUE,))[0], mesh.submesh((ORGAN,))[0])
    )
    u_tissue, u_organ = whole.u[tissue_of.query(tissue.nodes)[1]], whole.u[organ_of.query(organ.nodes)[1]]
    faces, _ = organ.mesh.boundary
    shared = np.unique(organ.face_nodes(faces))
    there = cKDTree(tissue.nodes).query(organ.nodes[shared])[1]
    outer = np.flatnonzero(np.isclose(np.abs(tissue.nodes).max(axis=1), np.abs(mesh.points).max()))
    materials = sphere_materials(50.0)
    force = tissue_reaction(tissue, {TISSUE: materials[TISSUE]}, InterfaceMotion(there, u_tissue[there]), outer)
    hold = organ_terms(organ, InterfaceMotion(shared, u_organ[shared]), force, 20.0)
    alone = Assembler(organ, np.ones(3 * organ.n_nodes, dtype=bool), [*hold, cap_pull(organ, faces)])
    found = solve_equilibrium(
        alone, {ORGAN: materials[ORGAN]}, options=NewtonOptions(rtol=1e-11, follow_buckling=False)
    )
    assert found.converged and found.stable, found.reason
    assert np.abs(found.u - u_organ).max() < 1e-6 * np.abs(u_organ).max()


def test_an_organ_too_soft_for_its_dead_load_is_reported_not_converged(problem: IdentificationProblem) -> None:
    coupled = plain_scene(problem, ELEMENT, walls=synthetic_case.FREE)
    scene = ContactForceScene(SharedGeometry.of(problem, ELEMENT), coupled.settle(TRUTH).equilibrium.u)
    found = scene.solve(TRUTH - np.log(4.0))
    assert not found.converged
    assert found.reason != "" and np.isfinite(found.u).all()


def test_rigid_hold_resists_all_rigid_motions_and_no_strain() -> None:
    x = np.random.default_rng(2).normal(size=(12, 3))
    hold = RigidHold.at(x, np.arange(12), np.zeros((12, 3)), 3.0)
    stretch = (x - x.mean(axis=0)) * np.array([0.1, -0.05, -0.05])
    inertia = (x - x.mean(axis=0)).T @ (x - x.mean(axis=0))
    assert np.linalg.matrix_rank(hold.rows) == 6
    for move in (np.tile([1.0, 0, 0], (12, 1)), np.cross([0, 0, 1.0], x - x.mean(axis=0))):
        assert hold.evaluate(move, 1.0, 1)[0] == pytest.approx(1.5 * (move**2).sum())
    assert hold.evaluate(stretch, 1.0, 1)[0] < 1.5 * (stretch**2).sum()
    assert np.linalg.det(inertia) > 0.0


def test_identification_with_contact_forces_names_the_stiffer_half(problem: IdentificationProblem, tmp_path) -> None:  # type: ignore[no-untyped-def]
    np.savez(tmp_path / "problem.npz", **problem.arrays())
    options = IdentifyOptions(method="gauss-newton", boundary="contact-force", element="p1p1")
    found = identify(tmp_path, [tmp_path / "problem.npz"], options, "test", Reporter(lambda m: None))
    G = np.exp(found.theta)
    assert G[1] > G[0]


def test_an_unknown_boundary_is_refused() -> None:
    with pytest.raises(InputError, match="boundary 'glue' is unknown; choose one of coupled, contact-force"):
        IdentifyOptions(boundary="glue")
