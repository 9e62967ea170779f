"""What is to be seen of an effect in a body's states: how far it moves the organ, its surfaces and points without contours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.imaging.labels import ORGAN_LABELS
from palpate.validate.blind.simulator.fem import Body
from palpate.validate.blind.simulator.newton import slopes_in
from palpate.validate.blind.simulator.simulated_body import Simulated
from palpate.validate.blind.simulator.states import Shown, equilibrium_near, held_nodes

# What an effect does along the organ's normal in one state, (k,), and what the two stiffnesses do, (k, 2) per ln G; both times
# the square root of each node's share of the surface.
Rows = tuple[FloatArray, FloatArray]


def joint_mm(states: Sequence[Rows]) -> tuple[float, float]:
    """rms over the surfaces of all states of what the effect does, and of what one change of the two stiffnesses leaves of it, mm."""
    share = 1.0 / np.sqrt(len(states))
    done = np.concatenate([share * rows[0] for rows in states])
    D = np.concatenate([share * rows[1] for rows in states])
    left = done - D @ np.linalg.lstsq(D, done, rcond=None)[0]
    return float(np.linalg.norm(done)), float(np.linalg.norm(left))


def effect_rows(
    s: Simulated,
    plain: Simulated,
    boundary: Mapping[str, IntArray],
    rest: Shown,
    deformed: Shown,
    near: FloatArray | None = None,
) -> Rows:
    """What the effect does along the organ's normal in one deformed state, and what the stiffnesses do.

    The plain body starts from the shape that the scan at rest shows. near : (n, 3) mm, its deformed state or one like it, if known.
    """
    body = s.body
    if rest.u.any():
        body, near = Body(body.points + rest.u[: len(body.points)], body.cells, body.regions), deformed.u - rest.u
    model = Simulated(body, plain.organ_faces, plain.G, plain.K, plain.growth, plain.fibre)
    known = {name: motion for name, motion in deformed.motions.items() if name != "bone"}
    driven = held_nodes(s.body, boundary, known) - np.nan_to_num(held_nodes(s.body, boundary, rest.motions))
    driven = driven + _wall_errors(s, boundary, deformed)
    laws = model.laws()
    u = equilibrium_near(deformed.u if near is None else near, body, laws, driven)
    nodes, normals, area = _surface(body.nodes + u, body.face_nodes(s.organ_faces))
    seen = scanned(s, s.body.nodes + deformed.u)
    done = ((seen - body.nodes - u)[nodes] * normals).sum(axis=1)
    if s.offset is not None:
        done = done + s.offset(normals)
    moved = slopes_in(body, laws, ORGAN_LABELS, u, driven)
    w = np.sqrt(area / area.sum())
    D = np.stack([(m[nodes] * normals).sum(axis=1) for m in moved], axis=1) * w[:, None]
    return w * done, D


def true_surfaces(s: Simulated, rest: Shown, deformed: Shown) -> dict[str, FloatArray | IntArray]:
    """The organ as scans would show it without noise: points (k, 3) mm deformed, at_rest (k, 3) the same at rest, faces (f, 3) of both."""
    faces = s.body.face_nodes(s.organ_faces)
    seen = scanned(s, s.body.nodes + deformed.u)
    nodes, normals, _ = _surface(seen, faces)
    points = seen[nodes]
    if s.offset is not None:
        points = points + s.offset(normals)[:, None] * normals
    number = np.full(len(s.body.nodes), -1)
    number[nodes] = np.arange(len(nodes))
    four = faces[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    return {"points": points, "at_rest": (s.body.nodes + rest.u)[nodes], "faces": number[four]}


def scanned(s: Simulated, points: FloatArray) -> FloatArray:
    """Where the deformed scan shows points (k, 3) mm."""
    return points if s.scan is None else points + s.scan(points)


def _wall_errors(s: Simulated, boundary: Mapping[str, IntArray], deformed: Shown) -> FloatArray:
    """How far (n, 3) mm the deformed scan and its contours put the nodes of the walls off."""
    off = np.zeros_like(s.body.nodes)
    if s.scan is None and not s.wall_offsets:
        return off
    at = s.body.nodes + deformed.u
    for name in ("rectum", "bladder"):
        if name in boundary:
            nodes, inwards, _ = _surface(
                at, s.body.face_nodes(boundary[name])
            )  # normals of the mesh look into the hollow
            off[nodes] = scanned(s, at[nodes]) - at[nodes] - s.wall_offsets.get(name, 0.0) * inwards
    for name in {"bone", "outer"} & set(boundary):
        off[np.unique(s.body.face_nodes(boundary[name]))] = 0.0
    return off


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


def marked(s: Simulated, rng: np.random.Generator) -> IntArray:
    """Four nodes inside the organ."""
    corners = np.unique(s.body.cells[s.in_organ])
    inside = np.setdiff1d(corners, np.unique(s.organ_faces))
    return np.asarray(rng.permutation(inside if len(inside) >= 4 else corners)[:4])


def read_marks(
    s: Simulated, chosen: IntArray, state: Shown, rng: np.random.Generator, sd_mm: float = 0.3, is_rest: bool = False
) -> FloatArray:
    """Where a scan of a state shows nodes chosen (k,), (k, 3) mm, with an error of sd_mm an axis."""
    at = s.body.points[chosen] + state.u[chosen]
    seen = at if is_rest else scanned(s, at)
    return np.asarray(seen + rng.normal(0.0, sd_mm, at.shape))
