"""A small case with truth: a ball in two halves in a block of tissue, squeezed between a wall and bone, its sides free.

The truth is computed on a finer mesh with another element than the one that identifies; the pushed face lies on a known surface
and slides along it without friction in both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.forward.coupled_scene import CoupledScene, SceneOptions
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts, IdentificationProblem, Surface, SurfacePair

RADIUS, HALF = 10.0, 15.0
FACTS = Facts(noise_sd_mm=0.05, noise_correlation_mm=5.0)


def block(n: int, shells: int, layers: int) -> TetMesh:
    """Ball halves 1 (x > 0) and 2 in tissue 3."""
    mesh = sphere_in_cube(n, shells, layers, RADIUS, HALF)
    centre = mesh.points[mesh.cells].mean(axis=1)
    return TetMesh(mesh.points, mesh.cells, np.where(mesh.regions == 3, 3, np.where(centre[:, 0] > 0.0, 1, 2)))


def push(x: np.ndarray, z: np.ndarray, depth: float) -> np.ndarray:
    """How far the face y = HALF moves along -y, mm: uneven and off both axes, so that no symmetry hides a mistake."""
    return depth * (0.6 + 0.4 * np.exp(-(((x - 3.0) / 9.0) ** 2) - ((z + 2.0) / 10.0) ** 2))


def wall(depth: float, steps: int = 40) -> Surface:
    """The pushed face as triangles, normals into the tissue as those of a hollow organ beyond it."""
    axis = np.linspace(-HALF - 9.0, HALF + 9.0, steps)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    y = HALF - push(x, z, depth)
    index = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, np.full(len(faces), 6))


def problem(
    G: tuple[float, float] = (30.0, 70.0), depth: float = 6.0, fine: int = 5, coarse: int = 4
) -> IdentificationProblem:
    """The case as identification sees it: coarse mesh, surfaces of both states from the fine quadratic solution."""
    truth = _posed(block(fine, 2, 2), depth, None)
    scene = CoupledScene(truth, SceneOptions(element="p2"))
    settled = scene.settle(np.log(G))
    assert settled.equilibrium.converged, settled.equilibrium.reason
    return _posed(block(coarse, 1, 2), depth, _organ(scene, settled.equilibrium.u))


def _posed(mesh: TetMesh, depth: float, organ: SurfacePair | None) -> IdentificationProblem:
    faces, _ = mesh.boundary
    y = mesh.points[faces][:, :, 1]
    front, back = (y > HALF - 1e-6).all(axis=1), (y < 1e-6 - HALF).all(axis=1)
    if organ is None:
        ball, owner = mesh.region_boundary((1, 2))
        rest = Surface(mesh.points, ball, mesh.regions[owner])
        organ = SurfacePair(rest, rest)
    return IdentificationProblem(
        mesh,
        {"rectum": faces[front], "bone": faces[back]},
        {"rectum": SurfacePair(wall(0.0), wall(depth))},
        organ,
        FACTS,
        {1: "prostate_left", 2: "prostate_right"},
    )


def _organ(scene: CoupledScene, u: np.ndarray) -> SurfacePair:
    """The ball's surface, each quadratic face as four triangles, at rest and displaced."""
    mesh = scene.space.mesh
    faces, owner = mesh.region_boundary((1, 2))
    nodes = scene.space.face_nodes(faces)
    four = nodes[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    used, inverse = np.unique(four, return_inverse=True)
    rest = Surface(scene.space.nodes[used], inverse.reshape(-1, 3), np.repeat(mesh.regions[owner], 4))
    return SurfacePair(rest, replace(rest, points=(scene.space.nodes + u)[used]))
