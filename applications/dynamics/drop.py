"""Fall of an organ onto a dish (Fig 15a of Yang & Lin, MaterialCloning)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from palpate.applications.dynamics.contact import Contact, Layer
from palpate.applications.dynamics.drop_watch import FallFigures, Watch, energies_of, fall_figures
from palpate.applications.dynamics.march import MarchOptions, march, open_ledger
from palpate.applications.dynamics.mass import KG_MM3, STANDARD_GRAVITY
from palpate.applications.dynamics.rigid import RigidSurface, dish
from palpate.applications.dynamics.system import MovingBody
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.space import Space
from palpate.core.mesh import TetMesh
from palpate.core.worker.progress import Progress, silent

# A face with mid-edge nodes 01, 12, 20 as four triangles.
_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
# The dish's rim over half the widest organ's width, and the radius of its sphere over that of its rim.
_ROOM, _HOLLOW = 1.6, 1.6


@dataclass(frozen=True)
class DropOptions:
    """height : mm that the organ falls until it touches the dish. seconds : of motion. frames : a second of motion,
    kept for a film.

    dt : s, longest time step. damping : s, see `viscosity`. density : kg/m3. friction : Coulomb's coefficient on the
    dish. layer : mm and kPa of the layer in which the dish presses back, see `contact`. element : see `fem.elements`.
    """

    height: float = 30.0
    seconds: float = 0.6
    frames: float = 240.0
    dt: float = 1e-3
    damping: float = 1e-3
    density: float = 1050.0
    friction: float = 0.2
    layer: tuple[float, float] = (0.3, 30.0)
    element: str = "p1p1"


class DropFigures(FallFigures):
    """The same with the seconds that it took, the number of tetrahedra, and the options it was made with."""

    seconds: float
    cells: int
    options: dict[str, object]


@dataclass(frozen=True, eq=False)
class Drop:
    """Result of a fall: points (frames, n, 3) mm of the organ's surface at times (frames,) s, +z up, the dish's lowest
    point at 0.

    faces : (f, 3) outwards, regions (f,) of them. figures : plain values, see `drop`.
    energies : by name and "time_s", after every step (steps + 1,), mN mm.
    """

    times: FloatArray
    points: FloatArray
    faces: IntArray
    regions: IntArray
    figures: DropFigures
    energies: dict[str, FloatArray]


def dish_for(meshes: list[TetMesh]) -> RigidSurface:
    """A dish wide enough for every one of these, its lowest point at the origin."""
    half = max(float(np.ptp(m.points[:, :2], axis=0).max()) for m in meshes) / 2.0
    return dish((0.0, 0.0, 0.0), _HOLLOW * _ROOM * half, _ROOM * half)


def drop(
    mesh: TetMesh,
    materials: Mapping[int, Material],
    on: RigidSurface,
    options: DropOptions | None = None,
    progress: Progress = silent,
) -> Drop:
    """Fall of an organ, its z axis upright, its centre above that of the dish.

    figures: fall_mm, fall_time_s and the time's relative error against the closed form; impact_speed_mm_s; rebound_mm,
    how high the lowest point comes back above the layer; flattest, the least height relative to that at rest;
    deepest_penetration_mm and nearest_mm, of all corners, edges and faces; energy_growth, what tissue and friction took
    up and what is left unaccounted for, relative to the energy of the fall; steps and seconds it took. Raises
    InputError for options that make no sense, ConvergenceError where the motion cannot be followed.
    """
    options = options or DropOptions()
    _check(options)
    began = time.perf_counter()
    body, space, faces = _body(mesh, materials, on, options)
    watch = Watch(space.nodes, faces, on)
    motion = body.at_rest()
    watch.see(motion)
    ledger = open_ledger(body, motion, options.height)
    count = max(1, round(options.seconds * options.frames))
    times = options.seconds * np.arange(count + 1) / count
    frames = [space.nodes + motion.u]
    for k, until in enumerate(times[1:], 1):
        motion = march(body, motion, float(until), MarchOptions(options.dt), ledger, watch.see)
        frames.append(space.nodes + motion.u)
        progress(k / count, f"{1e3 * until:.0f} of {1e3 * options.seconds:.0f} ms")
    figures: DropFigures = {
        **fall_figures(watch, ledger, options.layer[0]),
        "seconds": time.perf_counter() - began,
        "cells": len(mesh.cells),
        "options": asdict(options),
    }
    return _drop(np.array(frames), times, space, figures, energies_of(ledger))


def _check(options: DropOptions) -> None:
    limits = {"height": (1.0, 1000.0), "seconds": (0.01, 10.0), "frames": (1.0, 10_000.0), "dt": (1e-5, 1e-2),
              "damping": (0.0, 1.0), "density": (100.0, 20_000.0), "friction": (0.0, 2.0)}  # fmt: skip
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise InputError(f"{name} is {value:g}; a drop takes {low:g} to {high:g}")


def _body(
    mesh: TetMesh, materials: Mapping[int, Material], on: RigidSurface, options: DropOptions
) -> tuple[MovingBody, Space, IntArray]:
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    points = mesh.points - [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0]
    points = points + [0.0, 0.0, options.height - _clearance(points, on)]
    space = Space.of(TetMesh(points, mesh.cells, mesh.regions), options.element)
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials(materials)
    faces, _ = mesh.boundary
    contact = Contact(space, faces, on, Layer(*options.layer, friction=options.friction, sticking=5.0))
    gravity = (0.0, 0.0, -STANDARD_GRAVITY)
    body = MovingBody(assembler, options.density * KG_MM3, gravity, options.damping, contact)
    return body, space, faces


def _clearance(points: FloatArray, on: RigidSurface) -> float:
    """Vertical distance, mm, that points (n, 3) can fall until the first touches the dish, which ends at its rim."""
    height = LinearNDInterpolator(on.points[:, :2], on.points[:, 2])(points[:, :2])
    return float(np.min(np.where(np.isnan(height), np.inf, points[:, 2] - height)))


def _drop(
    frames: FloatArray, times: FloatArray, space: Space, figures: DropFigures, energies: dict[str, FloatArray]
) -> Drop:
    """Result of a fall on the nodes of the surface. Each face of a quadratic cell becomes four triangles."""
    faces, owner = space.mesh.boundary
    regions, nodes = space.mesh.regions[owner], space.face_nodes(faces)
    if nodes.shape[1] == 6:
        nodes, regions = nodes[:, _QUARTERS].reshape(-1, 3), np.repeat(regions, len(_QUARTERS))
    used, triangles = np.unique(nodes, return_inverse=True)
    return Drop(times, frames[:, used], triangles.reshape(-1, 3), regions, figures, energies)
