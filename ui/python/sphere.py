"""A body of known stiffness to try the program on: a ball in a cube of softer tissue, pushed from one side."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts, IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.ui.python.checks import positive, whole

_RADIUS, _HALF = 10.0, 15.0
_WALL_STEPS = 30


class Sphere(TypedDict):
    """Arguments of `palpate.identify`: see there."""

    mesh: TetMesh
    rest: Surface
    deformed: Surface
    fixed: BoolArray
    driven: tuple[BoolArray, Surface]


def example_sphere(G: float = 60.0, depth_mm: float = 6.0, fineness: int = 3) -> Sphere:
    """A ball of radius 10 mm and shear modulus G (kPa) in a cube of 20 kPa, one face pushed in by depth_mm, the opposite one held.

    Both surfaces are those of a finer mesh than the one that is returned, on which quadratic elements deform it: one scanner shows
    both. The returned mesh's own boundary, of larger triangles, lies up to a third of a millimetre inside of them.
    Raises InputError for numbers that are none or not above 0, ConvergenceError where the push is too deep to be solved.
    """
    G, depth_mm, fineness = positive(G, "G"), positive(depth_mm, "depth_mm"), whole(fineness, "fineness", 1)
    coarse, fine = sphere_in_cube(fineness, 1, 2, _RADIUS, _HALF), sphere_in_cube(fineness + 1, 2, 2, _RADIUS, _HALF)
    wall = _wall(depth_mm)
    settled = plain_scene(truth := _posed(fine, depth_mm), "p2").settle(np.log([G]))
    if not settled.equilibrium.converged:
        raise ConvergenceError(
            f"the ball could not be pushed by {depth_mm:g} mm: {settled.equilibrium.reason}; push less"
        )
    n = len(truth.mesh.points)
    surface = truth.organ.rest
    deformed = Surface(surface.points + settled.equilibrium.u[:n], surface.faces, surface.region)
    y = coarse.points[:, 1]
    driven = (y > _HALF - 1e-6, wall)
    return {"mesh": coarse, "rest": surface, "deformed": deformed, "fixed": y < 1e-6 - _HALF, "driven": driven}


def _posed(mesh: TetMesh, depth: float) -> IdentificationProblem:
    faces, _ = mesh.boundary
    y = mesh.points[faces][:, :, 1]
    ball, owner = mesh.region_boundary((1,))
    rest = Surface(mesh.points, ball, mesh.regions[owner])
    boundary = {"rectum": faces[(y > _HALF - 1e-6).all(axis=1)], "bone": faces[(y < 1e-6 - _HALF).all(axis=1)]}
    pushed = {"rectum": SurfacePair(_wall(0.0), _wall(depth))}
    return IdentificationProblem(mesh, boundary, pushed, SurfacePair(rest, rest), Facts(), {1: "ball"})


def _wall(depth: float) -> Surface:
    """The pushed face, wider than the cube, normals into the tissue; deeper in the middle and a little to one side."""
    axis: FloatArray = np.linspace(-_HALF - 9.0, _HALF + 9.0, _WALL_STEPS)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    y = _HALF - depth * (0.6 + 0.4 * np.exp(-(((x - 3.0) / 9.0) ** 2) - ((z + 2.0) / 10.0) ** 2))
    index = np.arange(_WALL_STEPS**2).reshape(_WALL_STEPS, _WALL_STEPS)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces: IntArray = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, np.full(len(faces), 3))
