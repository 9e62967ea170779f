"""The states that the two scans show of a simulated body, and how much of an effect is there to be seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.errors import ConvergenceError
from palpate.segmentation.gap_truth.body import Body, Laws
from palpate.segmentation.gap_truth.newton import equilibrium, slopes_in
from palpate.segmentation.gap_truth.simulated import Simulated
from palpate.segmentation.labels import ORGAN_LABELS
from palpate.segmentation.simulate_motion import WallMotion
from palpate.segmentation.simulate_warp import BackwardMap
from palpate.segmentation.smooth_field import FloatArray, IntArray

# How far from bone the region's edge is drawn along with it.
_DRAWN_MM = 15.0
# No tissue gives up so much of its volume that this is left of a cell.
_FLAT = 0.1


@dataclass(frozen=True, eq=False)
class Shown:
    """One state: its hollows' and bones' motions from the stress-free body, and u (n, 3) mm of the nodes."""

    motions: Mapping[str, WallMotion]
    u: FloatArray


@dataclass(frozen=True, eq=False)
class Part:
    """A share of a motion."""

    motion: WallMotion
    share: float

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return self.share * self.motion.displacement(points)


def shown(
    s: Simulated, boundary: Mapping[str, IntArray], walls: Mapping[str, WallMotion], near: FloatArray | None = None
) -> tuple[Shown, Shown]:
    """The states at rest and deformed. boundary : name -> faces (f, 3). near : (n, 3) mm, a deformed state like this one, if known.

    Raises ConvergenceError when one has no equilibrium.
    """
    still = Shown({}, np.zeros_like(s.body.nodes))
    rest = still
    if s.filled:
        before = {name: Part(walls[name], share) for name, share in s.filled.items() if name in walls}
        rest, near = _state(s, boundary, before, None, None), None
    motions = dict(walls)
    if s.filled:  # what the walls do between the scans comes on top of what they did before
        motions = {name: Part(walls[name], 1.0 + s.filled.get(name, 0.0)) for name in walls}
    if s.bone is not None:
        motions["bone"] = s.bone
    return rest, _state(s, boundary, motions, s.load, near)


def _state(
    s: Simulated,
    boundary: Mapping[str, IntArray],
    motions: Mapping[str, WallMotion],
    load: FloatArray | None,
    near: FloatArray | None,
) -> Shown:
    held = held_nodes(s.body, boundary, motions)
    u = _from(near, s.body, s.laws(), held, load)
    ratio = np.linalg.det(s.body.gradients(u))
    if ratio.min() < _FLAT:
        raise ConvergenceError(f"the simulated tissue folds (volume ratio {ratio.min():.2f}); make the walls move less")
    return Shown(motions, u)


def _from(
    near: FloatArray | None, body: Body, laws: Laws, held: FloatArray, load: FloatArray | None = None
) -> FloatArray:
    """Equilibrium from a state like it, or, where that leads nowhere, from rest."""
    if near is not None:
        try:
            return equilibrium(body, laws, held, load, start=near)
        except ConvergenceError:
            pass
    return equilibrium(body, laws, held, load)


def held_nodes(body: Body, boundary: Mapping[str, IntArray], motions: Mapping[str, WallMotion]) -> FloatArray:
    """(n, 3) mm where the boundary holds a node, NaN elsewhere; bone has the last word but for the region's edge."""
    held = np.full((len(body.nodes), 3), np.nan)
    for name in sorted(boundary, key=("rectum", "bladder", "bone", "outer").index):
        nodes = np.unique(body.face_nodes(boundary[name]))
        held[nodes] = motions[name].displacement(body.nodes[nodes]) if name in motions else 0.0
    if "bone" in motions and "bone" in boundary and "outer" in boundary:
        # The edge goes along where bone meets it: one that stayed would fold the cells between them.
        edge, bone = (np.unique(body.face_nodes(boundary[name])) for name in ("outer", "bone"))
        apart = cKDTree(body.nodes[bone]).query(body.nodes[edge])[0]
        held[edge] = np.exp(-0.5 * (apart / _DRAWN_MM) ** 2)[:, None] * motions["bone"].displacement(body.nodes[edge])
    return held


def backward(s: Simulated, boundary: Mapping[str, IntArray], state: Shown) -> BackwardMap:
    """Where each point of a state was in the stress-free body."""
    nodes = {name: np.unique(s.body.face_nodes(faces)) for name, faces in boundary.items()}
    return BackwardMap(s.body, state.u, nodes, dict(state.motions))


def effect_mm(
    s: Simulated,
    plain: Simulated,
    boundary: Mapping[str, IntArray],
    rest: Shown,
    deformed: Shown,
    near: FloatArray | None = None,
) -> tuple[float, float]:
    """rms along the organ's normal of what the effect does, all of it and what no change of the two stiffnesses can do, mm.

    The plain body starts from the shape that the scan at rest shows. near : (n, 3) mm, its deformed state or one like it, if known.
    """
    body = s.body
    if rest.u.any():
        body, near = Body(body.points + rest.u[: len(body.points)], body.cells, body.regions), deformed.u - rest.u
    model = Simulated(body, plain.organ_faces, plain.G, plain.K, plain.growth, plain.fibre)
    known = {name: motion for name, motion in deformed.motions.items() if name != "bone"}
    driven = held_nodes(s.body, boundary, known) - np.nan_to_num(held_nodes(s.body, boundary, rest.motions))
    laws = model.laws()
    u = _from(deformed.u if near is None else near, body, laws, driven)
    nodes, normals, area = _surface(body.nodes + u, body.face_nodes(s.organ_faces))
    done = ((s.body.nodes + deformed.u - body.nodes - u)[nodes] * normals).sum(axis=1)
    if s.offset is not None:
        done = done + s.offset(normals)
    moved = slopes_in(body, laws, ORGAN_LABELS, u, driven)
    w = np.sqrt(area / area.sum())
    D = np.stack([(m[nodes] * normals).sum(axis=1) for m in moved], axis=1) * w[:, None]
    left = w * done - D @ np.linalg.lstsq(D, w * done, rcond=None)[0]
    return float(np.linalg.norm(w * done)), float(np.linalg.norm(left))


def true_surfaces(s: Simulated, rest: Shown, deformed: Shown) -> dict[str, FloatArray | IntArray]:
    """The organ as scans would show it without noise: points (k, 3) mm deformed, at_rest (k, 3) the same at rest, faces (f, 3) of both."""
    faces = s.body.face_nodes(s.organ_faces)
    nodes, normals, _ = _surface(s.body.nodes + deformed.u, faces)
    points = (s.body.nodes + deformed.u)[nodes]
    if s.offset is not None:
        points = points + s.offset(normals)[:, None] * normals
    number = np.full(len(s.body.nodes), -1)
    number[nodes] = np.arange(len(nodes))
    four = faces[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    return {"points": points, "at_rest": (s.body.nodes + rest.u)[nodes], "faces": number[four]}


def _surface(at: FloatArray, faces: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Nodes of quadratic faces (f, 6), their mean unit normals (k, 3) and areas (k,) mm2, for nodes lying at (n, 3)."""
    X = at[faces[:, :3]]
    cross = 0.5 * np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    total, area = np.zeros_like(at), np.zeros(len(at))
    for column in faces.T:
        np.add.at(total, column, cross)
        np.add.at(area, column, np.linalg.norm(cross, axis=1) / 6.0)
    nodes = np.unique(faces)
    return nodes, total[nodes] / np.linalg.norm(total[nodes], axis=1)[:, None], area[nodes]


def landmarks(s: Simulated, rest: Shown, deformed: Shown, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Four points at rest and deformed, each (4, 3) mm, inside the organ; seen with 0.3 mm of error an axis in either scan."""
    corners = np.unique(s.body.cells[s.in_organ])
    inside = np.setdiff1d(corners, np.unique(s.organ_faces))
    chosen = rng.permutation(inside if len(inside) >= 4 else corners)[:4]
    at = s.body.points[chosen]
    return (
        at + rest.u[chosen] + rng.normal(0.0, 0.3, at.shape),
        at + deformed.u[chosen] + rng.normal(0.0, 0.3, at.shape),
    )
