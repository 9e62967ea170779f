"""How far quick answers to a touch are from the full solve, how fast they come, and how near a press on a ball is to Hertz.

Hertz: a ball of radius R1, Young's modulus E and Poisson's ratio nu, pressed by a rigid ball of radius R2 to a depth d that is small
against both, answers with F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5, 1/R = 1/R1 + 1/R2 (Johnson 1985, Contact Mechanics, ch. 4).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.full import FullTouch
from palpate.applications.touch.probe import Contact
from palpate.applications.touch.quick import QuickAnswer, QuickTouch
from palpate.applications.touch.session import Session
from palpate.core.fem.meshes import sphere_in_cube, with_regions
from palpate.core.mesh import TetMesh
from palpate.core.worker.progress import Progress, silent

_HALF_AXES = np.array([22.0, 18.0, 20.0])
_STIFFNESS = {1: 20.0, 2: 60.0}
_RADIUS = 8.0
_BALL, _BALL_G = 20.0, 10.0
_ROUNDS = 3
_DEPTHS = (0.2, 0.3, 0.4, 0.6)


class PokeRow(TypedDict):
    """One poke: cost of the quick answer, size of the full solve's force (mN), and how far the quick one is from it, of that size."""

    seconds: float
    cpu_seconds: float
    iterations: int
    good: bool
    force_mn: float
    converged: bool
    error: float
    estimate: float


class HertzRow(TypedDict):
    """Force on the ball at one depth, Hertz's, and the relative difference."""

    depth_mm: float
    force_mn: float
    hertz_mn: float
    error: float


class _Pokes(TypedDict):
    pokes: int
    corrected_by_full: int
    full_without_equilibrium: int
    largest_error: float
    median_error: float
    error_above_estimate: int
    answers_per_second: float
    answers_per_cpu_second: float
    slowest_ms: float


class _Path(TypedDict):
    path_answers_per_second: float
    path_answers_per_cpu_second: float
    path_corrected_by_full: int


class TouchTable(_Pokes, _Path):
    """What was touched; figures over all pokes and along a path; Hertz; a row a poke."""

    cells: int
    surface_nodes: int
    edge_mm: float
    probe_radius_mm: float
    deepest_mm: float
    setup_seconds: float
    hertz: list[HertzRow]
    rows: list[PokeRow]


@dataclass(frozen=True)
class TouchOptions:
    """pokes : random ones. deepest : mm. fine : cells along a quarter turn of Hertz's ball. seed : of the places."""

    pokes: int = 200
    deepest: float = 5.0
    fine: int = 8
    seed: int = 1

    @classmethod
    def quick(cls, seed: int = 1) -> TouchOptions:
        """In short."""
        return cls(pokes=12, fine=6, seed=seed)


def touch_study(
    options: TouchOptions | None = None, body: Body | None = None, progress: Progress = silent
) -> TouchTable:
    """body : what is touched; a halved ellipsoid of 3,888 cells with 20 and 60 kPa when None."""
    options = options or TouchOptions()
    body = body or halved_ellipsoid()
    began = time.perf_counter()
    session = Session(body, _RADIUS)
    setup = time.perf_counter() - began
    pokes = random_pokes(session, options)
    session.quick.answer(pokes[0])  # what compiles at first use has done so
    rows = _compared(body, session.quick, pokes, progress)
    return {
        "cells": len(body.mesh.cells), "surface_nodes": len(body.surface.nodes), "edge_mm": body.surface.edge,
        "probe_radius_mm": _RADIUS, "deepest_mm": options.deepest, "setup_seconds": setup,
        **_summary(rows), **_path(session, options), "hertz": hertz(options.fine), "rows": rows,
    }  # fmt: skip


def halved_ellipsoid(n: int = 6, shells: int = 2) -> Body:
    """Half-axes 22, 18 and 20 mm, in the bed of tissue with G = 20 kPa; left 20, right 60 kPa."""
    ball, _ = sphere_in_cube(n, shells, 1, radius=1.0, half_width=2.0).submesh((1,))
    mesh = with_regions(
        TetMesh(ball.points * _HALF_AXES, ball.cells, ball.regions), lambda x: np.where(x[:, 0] > 0.0, 1, 2)
    )
    return Body(mesh, _STIFFNESS, {1: "left", 2: "right"})


def random_pokes(session: Session, options: TouchOptions) -> list[Contact]:
    """Anywhere on the surface, equally by area, to any depth; one in five pulls."""
    rng = np.random.default_rng(options.seed)
    s = session.body.surface
    faces = rng.choice(len(s.faces), size=options.pokes, p=s.face_area / s.face_area.sum())
    share = rng.dirichlet((1.0, 1.0, 1.0), size=options.pokes)
    deepest = min(options.deepest, session.deepest)
    depths = rng.uniform(0.05 * deepest, deepest, size=options.pokes) * np.where(
        rng.random(options.pokes) < 0.2, -1.0, 1.0
    )
    places = np.einsum("pk,pki->pi", share, s.points[s.faces[faces]])
    return [session.contact(s.nearest(x), float(d)) for x, d in zip(places, depths, strict=True)]


def _compared(body: Body, quick: QuickTouch, pokes: list[Contact], progress: Progress) -> list[PokeRow]:
    full, rows = FullTouch(body), list[PokeRow]()
    for k, contact in enumerate(pokes):
        progress(k / len(pokes), f"poke {k + 1} of {len(pokes)}")
        found, wall, cpu = _timed(quick, contact)
        began = time.perf_counter(), time.process_time()
        truth = full.solve(contact)
        if not found.good:  # what a person would wait for
            wall, cpu = wall + time.perf_counter() - began[0], cpu + time.process_time() - began[1]
        size = float(np.linalg.norm(truth.force))
        rows.append({
            "seconds": wall, "cpu_seconds": cpu, "iterations": found.iterations, "good": found.good, "force_mn": size,
            "converged": truth.converged, "error": float(np.linalg.norm(found.force - truth.force)) / size,
            "estimate": found.estimate / size,
        })  # fmt: skip
    return rows


def _timed(quick: QuickTouch, contact: Contact) -> tuple[QuickAnswer, float, float]:
    """An answer from rest, and the least of its seconds by the clock and by the processor: the machine may have other work."""
    walls, cpus = [], []
    for _ in range(_ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        found = quick.answer(contact)
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return found, min(walls), min(cpus)


def _summary(rows: list[PokeRow]) -> _Pokes:
    good = [r for r in rows if r["good"] and r["converged"]]
    errors, estimates = np.array([r["error"] for r in good]), np.array([r["estimate"] for r in good])
    return {
        "pokes": len(rows), "corrected_by_full": sum(not r["good"] for r in rows),
        "full_without_equilibrium": sum(not r["converged"] for r in rows),
        "largest_error": float(errors.max()), "median_error": float(np.median(errors)),
        "error_above_estimate": int((errors > estimates + 1e-4).sum()),
        "answers_per_second": 1.0 / float(np.mean([r["seconds"] for r in rows])),
        "answers_per_cpu_second": 1.0 / float(np.mean([r["cpu_seconds"] for r in rows])),
        "slowest_ms": 1e3 * max(r["seconds"] for r in rows),
    }  # fmt: skip


def _path(session: Session, options: TouchOptions, steps: int = 100) -> _Path:
    """Answers a second while the probe presses in, slides across the border between the regions and comes out."""
    deepest = min(options.deepest, session.deepest)
    session.touch(np.array([30.0, -60.0, 10.0]))
    wall, cpu = time.perf_counter(), time.process_time()
    for k in range(steps):
        t = k / (steps - 1.0)
        session.slide(np.array([30.0 - 60.0 * t, -60.0, 10.0]))
        session.press(deepest * min(1.0, 4.0 * t, 4.0 * (1.0 - t)))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {
        "path_answers_per_second": steps / wall, "path_answers_per_cpu_second": steps / cpu,
        "path_corrected_by_full": sum(a.full for a in session.answers[-steps:]),
    }  # fmt: skip


def hertz(fine: int = 8) -> list[HertzRow]:
    """Force on a rigid ball pressed into an equal elastic one, beside Hertz's."""
    mesh = ball_towards(fine, 3, _BALL, 0.7)
    held = np.flatnonzero(mesh.points[:, 2] < 0.0)
    body = Body(mesh, {1: _BALL_G}, {1: "ball"}, support="none", fixed=held)
    full, top, out = FullTouch(body), np.array([0.0, 0.0, _BALL]), list[HertzRow]()
    nu = body.poisson_ratio
    stiffness = 4.0 / 3.0 * 2.0 * _BALL_G * (1.0 + nu) / (1.0 - nu**2) * np.sqrt(0.5 * _BALL)
    state = None
    for depth in _DEPTHS:
        start = top + np.array([0.0, 0.0, _BALL])
        found = full.solve(body.press(start - [0.0, 0.0, depth], _BALL, start), state)
        state = found.state
        force = float(found.force[2]) if found.converged else float("nan")
        closed = float(stiffness * depth**1.5)
        out.append({"depth_mm": depth, "force_mn": force, "hertz_mn": closed, "error": force / closed - 1.0})
    return out


def ball_towards(n: int, shells: int, radius: float, towards: float) -> TetMesh:
    """A ball whose cells are smaller by (1 - towards) / (1 + towards) at its top (+z) than they would be, and keep their shapes.

    Of the unit ball's own conformal maps (Moebius) the one that takes its centre to `towards` on the z axis.
    """
    ball, _ = sphere_in_cube(n, shells, 1, radius=1.0, half_width=2.0).submesh((1,))
    x, b = ball.points, np.array([0.0, 0.0, towards])
    along, square = x @ b, (x**2).sum(axis=1)
    above = (1.0 + 2.0 * along + square)[:, None] * b + (1.0 - towards**2) * x
    return TetMesh(radius * above / (1.0 + 2.0 * along + towards**2 * square)[:, None], ball.cells, ball.regions)
