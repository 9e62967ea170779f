"""Random scenes and particles, one per seed: shapes, elements, laws, loads and starts as wide as a swarm or a person may ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE, box, sphere_in_cube
from palpate.core.fem.scenes import Scene
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term, face_points
from palpate.core.fem.terms.loads import traction
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, NEO_HOOKEAN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh

SECOND_ORGAN = 2
STRAIN = 0.4  # largest nominal strain that any load asks for
BOUNDS_KPA = (5.0, 500.0)
ELEMENT_SHARES = {"p2p1": 0.4, "p1p1": 0.25, "p1": 0.2, "p2p0": 0.075, "p2": 0.075}


@dataclass(frozen=True, eq=False)
class RandomScene:
    """A scene, the start it is solved from (n, 3) or None, and what it is, for reports."""

    scene: Scene
    start: FloatArray | None
    description: dict[str, str | float | int]


def random_scene(seed: int) -> RandomScene:
    """The scene of this seed; the same on every machine."""
    rng = np.random.default_rng(seed)
    mesh = _random_mesh(rng)
    element = str(rng.choice(list(ELEMENT_SHARES), p=list(ELEMENT_SHARES.values())))
    space = Space.of(mesh, element)
    kind = str(rng.choice(list(_LOADS)))
    materials, moduli = _random_materials(rng)
    free, prescribed, terms = _LOADS[kind](rng, space, float(materials[TISSUE].law.shear_modulus_of(
        np.asarray(materials[TISSUE].values)[None])[0]))  # fmt: skip
    scene = Scene(Assembler(space, free.ravel(), terms), materials, prescribed.ravel())
    start, start_name = _random_start(rng, space)
    description: dict[str, str | float | int] = {
        "seed": seed,
        "cells": len(mesh.cells),
        "element": element,
        "load": kind,
        "start": start_name,
        "tissue": materials[TISSUE].law.name,
        "G_kpa_low": float(min(moduli)),
        "G_kpa_high": float(max(moduli)),
    }
    return RandomScene(scene, start, description)


def _random_mesh(rng: np.random.Generator) -> TetMesh:
    """100 to 600 cells: a ball or a skew block of one or two organ regions in tissue, sheared and stretched as a whole."""
    if rng.random() < 0.5:
        mesh = sphere_in_cube(*[(1, 1, 1), (1, 1, 2), (2, 1, 1), (2, 1, 2)][rng.integers(4)])
        organ = mesh.regions == ORGAN
        scale = 25.0
        points = mesh.points
    else:
        divisions = tuple(int(d) for d in rng.integers(3, 5, size=3))
        mesh = box([50.0] * 3, divisions, jitter=0.2, seed=int(rng.integers(1 << 30)))  # type: ignore[arg-type]
        scale = 25.0
        points = mesh.points - scale
        low, high = np.sort(rng.uniform(-0.8, 0.8, size=(2, 3)), axis=0)
        centre = points[mesh.cells].mean(axis=1) / scale
        organ = ((centre > low - 0.25) & (centre < high + 0.25)).all(axis=1)
        organ[np.argmin(np.abs(centre).max(axis=1))] = True
    side = np.asarray(points[mesh.cells].mean(axis=1) @ rng.normal(size=3) > 0.0)
    regions = np.where(organ, np.where(side & (rng.random() < 0.5), SECOND_ORGAN, ORGAN), TISSUE)
    shape = random_deformation_gradients(1, int(rng.integers(1 << 30)), stretch=(0.75, 1.3))[0]
    return TetMesh(points @ np.diag(np.linalg.svd(shape)[1]).T, mesh.cells, regions)


def random_deformation_gradients(n: int, seed: int, stretch: tuple[float, float] = (0.6, 1.6)) -> FloatArray:
    """n random F (n, 3, 3) = R1 diag(stretches) R2 with det F > 0 and arbitrary rotations."""
    rng = np.random.default_rng(seed)
    rotations = [np.linalg.qr(rng.normal(size=(n, 3, 3)))[0] for _ in range(2)]
    rotations = [R * np.sign(np.linalg.det(R))[:, None, None] for R in rotations]
    return np.einsum("nij,nj,njk->nik", rotations[0], rng.uniform(*stretch, size=(n, 3)), rotations[1])


def _random_materials(rng: np.random.Generator) -> tuple[dict[int, Material], list[float]]:
    """Organ moduli anywhere in the bounds; tissue of 20 kPa, linear as in the paper or, in a quarter, neo-Hookean."""
    materials, moduli = {}, []
    for region in (ORGAN, SECOND_ORGAN):
        G = float(np.exp(rng.uniform(*np.log(BOUNDS_KPA))))
        nu = float(rng.choice([0.45, 0.49, 0.495, 0.499]))
        moduli.append(G)
        materials[region] = Material(
            MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, nu), rng.uniform(0.05, 0.95))
        )
    G, nu = 20.0, float(rng.choice([0.4, 0.49]))
    law = LINEAR if rng.random() < 0.75 else NEO_HOOKEAN
    materials[TISSUE] = Material(law, np.array([G, bulk_modulus(G, nu)]))
    return materials, moduli


Load = tuple[BoolArray, FloatArray, list[Term]]


def _sides(space: Space) -> tuple[FloatArray, BoolArray]:
    """Half width along each axis (3,) and nodes on the six sides (n, 6): low x, y, z, high x, y, z."""
    half = np.abs(space.nodes).max(axis=0)
    return half, np.hstack([np.isclose(space.nodes, -half), np.isclose(space.nodes, half)])


def _strained(rng: np.random.Generator, space: Space, shear_modulus: float) -> Load:
    """The whole surface strained, volume kept within 3 %."""
    stretch = np.exp(rng.uniform(np.log(1.0 - STRAIN), np.log(1.0 + STRAIN), size=3))
    stretch = np.clip(stretch / np.prod(stretch) ** (1.0 / 3.0), 1.0 - STRAIN, 1.0 + STRAIN)
    stretch *= (rng.uniform(0.97, 1.03) / np.prod(stretch)) ** (1.0 / 3.0)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    surface = np.asarray(_sides(space)[1].any(axis=1))
    u = np.where(surface[:, None], space.nodes @ (turn @ np.diag(stretch - 1.0) @ turn.T).T, 0.0)
    return np.repeat(~surface[:, None], 3, axis=1), u, []


def _pressed(rng: np.random.Generator, space: Space, shear_modulus: float) -> Load:
    """One side moved as a whole, up to 40 % of the thickness towards the far side or along itself; the far side held."""
    half, on = _sides(space)
    axis = int(rng.integers(3))
    u = np.zeros_like(space.nodes)
    move = rng.uniform(-0.5, 0.5, size=3) * STRAIN
    move[axis] = rng.uniform(-1.0, 1.0) * STRAIN
    u[on[:, 3 + axis]] = 2.0 * half[axis] * move
    held = np.asarray(on[:, axis] | on[:, 3 + axis])
    return np.repeat(~held[:, None], 3, axis=1), u, []


def _pulled(rng: np.random.Generator, space: Space, shear_modulus: float) -> Load:
    """Traction on one side: shear up to 40 % strain of the tissue, with a normal part; the far side held."""
    half, on = _sides(space)
    axis = int(rng.integers(3))
    faces, _ = space.mesh.boundary
    top = faces[np.isclose(space.mesh.points[faces][:, :, axis], half[axis]).all(axis=1)]
    t = rng.uniform(-0.6, 0.6, size=3) * STRAIN * shear_modulus
    t[axis] = rng.uniform(-0.5, 1.5) * STRAIN * shear_modulus
    return np.repeat(~on[:, axis][:, None], 3, axis=1), np.zeros_like(space.nodes), [traction(space, top, t)]


def _dented(rng: np.random.Generator, space: Space, shear_modulus: float) -> Load:
    """A curved wall that the middle of a side must follow comes in by up to 40 % of half the least thickness."""
    half, on = _sides(space)
    axis = int(rng.integers(3))
    faces, _ = space.mesh.boundary
    X = space.mesh.points[faces]
    top = np.isclose(X[:, :, axis], half[axis]).all(axis=1)
    aside = np.abs(np.delete(X / half, axis, axis=2)).max(axis=(1, 2))
    top = faces[top & (aside < max(0.7, aside[top].min() + 1e-9))]
    points = face_points(space.nodes, space.face_nodes(top))
    radius = rng.uniform(2.0, 6.0) * half.max()
    depth = rng.uniform(0.0, STRAIN) * half.min()
    outward = np.eye(3)[axis]

    def ball(height: float) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
        """Signed distance of a ball whose top stands at this height on the axis."""

        def distance(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            d = x - outward * (height - radius)
            r = np.linalg.norm(d, axis=1)
            return r - radius, d / r[:, None]

        return distance

    stiffness = 50.0 * shear_modulus
    rest = points.positions(space.nodes)
    wall = SlidingWall.between(points, rest, ball(float(half[axis])), ball(float(half[axis]) - depth), stiffness)
    held = on[:, [k for k in range(6) if k != 3 + axis]].any(axis=1) & ~on[:, 3 + axis]
    return np.repeat(~held[:, None], 3, axis=1), np.zeros_like(space.nodes), [wall]


_LOADS: dict[str, Callable[[np.random.Generator, Space, float], Load]] = {
    "strained": _strained,
    "pressed": _pressed,
    "pulled": _pulled,
    "dented": _dented,
}


def _random_start(rng: np.random.Generator, space: Space) -> tuple[FloatArray | None, str]:
    """Half from rest; else a smooth guess, noise that turns cells inside out, or garbage that is not finite."""
    name = str(rng.choice(["rest", "smooth", "inverted", "not finite"], p=[0.5, 0.25, 0.2, 0.05]))
    if name == "rest":
        return None, name
    half = np.abs(space.nodes).max(axis=0)
    if name == "smooth":
        gradient = rng.uniform(-0.1, 0.1, size=(3, 3))
        return space.nodes @ gradient, name
    noise = rng.normal(size=space.nodes.shape) * half * rng.uniform(0.2, 1.0)
    if name == "not finite":
        noise[rng.integers(len(noise))] = np.nan
    return noise, name
