"""Patches of a bench body's surface as case.json states them: their faces, what they prescribe, and whether they hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.case.stated_files import MarkerState, MovedPatch, Patch, Support, by_axis
from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.diagnose.bench_bodies.problem import NO_AXIS, BodyPatch, PatchFacts
from palpate.core.errors import InputError
from palpate.core.forward.composition import PerAxis
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.triangles import areas

_ALL_AXES = "xyz"
# Smallest resistance to a rigid motion, over the largest, at which a body still counts as held: rounding is far below.
_HELD = 1e-6


def held_faces(mesh: TetMesh, supports: Sequence[Support], source: str) -> IntArray:
    """Boundary faces (f, 3) that supports hold along all axes; none where there is no such support.

    Raises InputError naming the support in `source`, the path of case.json, that lies on no face.
    """
    found = [
        _faces(mesh, s, f"{source}: support {_name(s, k)}")
        for k, s in enumerate(supports)
        if set(s.axes) == {*_ALL_AXES}
    ]
    return np.unique(np.vstack([np.zeros((0, 3), dtype=np.int64), *found]), axis=0)


def patches(mesh: TetMesh, supports: Sequence[Support], states: Sequence[MarkerState], source: str) -> list[BodyPatch]:
    """Supports that hold along some axes, and what is moved in each state. Raises InputError as `held_faces` does."""
    out = []
    for k, support in enumerate(supports):
        if set(support.axes) != {*_ALL_AXES}:
            x, y, z = (0.0 if axis in support.axes else None for axis in _ALL_AXES)
            faces = _faces(mesh, support, f"{source}: support {_name(support, k)}")
            out.append(BodyPatch(faces, PatchFacts(_name(support, k), (x, y, z)), _rim(mesh, support)))
    for k, state in enumerate(states):
        for j, moved in enumerate(state.moved):
            where = f"{source}: states[{k}].moved[{j}]"
            facts = _facts(moved, _name(moved, j), k, where)
            out.append(BodyPatch(_faces(mesh, moved, where), facts, _rim(mesh, moved)))
    return out


def check_held(mesh: TetMesh, held: IntArray, every: Sequence[BodyPatch], states: Sequence[str], source: str) -> None:
    """Raises InputError naming a state in which the body can still move as a whole."""
    for k, name in enumerate(states):
        acting = [p for p in every if p.facts.state in (None, k)]
        rows = [_rigid(mesh, held, range(3))]
        rows += [
            _rigid(mesh, p.faces, [i for i, d in enumerate(p.facts.displacement_mm) if d is not None]) for p in acting
        ]
        _, size, motions = np.linalg.svd(np.vstack([np.zeros((6, 6)), *rows]), full_matrices=False)
        if size[-1] < _HELD * max(size[0], 1e-30):
            raise InputError(
                f"{source}: in the state {name!r} the body can {_words(motions[-1])}: nothing holds it; add a support, or "
                "axes to one"
            )


def check_agreeing(held: IntArray, every: Sequence[BodyPatch], states: Sequence[str], source: str) -> None:
    """Raises InputError naming a state in which one face is given two displacements along one axis."""
    support = BodyPatch(held, PatchFacts("that holds along all axes", (0.0, 0.0, 0.0)))
    for k, name in enumerate(states):
        acting = [support, *(p for p in every if p.facts.state in (None, k))]
        for at, one in enumerate(acting):
            for other in acting[at + 1 :]:
                axis = _contradicted(one.facts.displacement_mm, other.facts.displacement_mm)
                shared = {tuple(f) for f in one.faces.tolist()} & {tuple(f) for f in other.faces.tolist()}
                if axis is not None and shared:
                    told = [f"{part.facts.displacement_mm[axis]:g} mm" for part in (one, other)]
                    raise InputError(
                        f"{source}: in the state {name!r} {len(shared)} faces lie in the support or patch {one.facts.name!r} and in "
                        f"{other.facts.name!r}, which prescribe {' and '.join(told)} along {_ALL_AXES[axis]}; correct one of them"
                    )


def _contradicted(one: PerAxis, other: PerAxis) -> int | None:
    """The first axis along which both prescribe a displacement, and not the same."""
    pairs = enumerate(zip(one, other, strict=True))
    return next((axis for axis, (a, b) in pairs if a is not None and b is not None and a != b), None)


def _faces(mesh: TetMesh, patch: Patch, where: str) -> IntArray:
    """Boundary faces (f, 3) of a patch. where : names it in errors."""
    faces = mesh.boundary[0]
    X = mesh.points[faces]
    chosen = np.ones(len(faces), dtype=bool)
    conditions = [_on_plane(X, patch, where), _within(X, patch, where)]
    if all(c is None for c in conditions):
        raise InputError(f"{where} says not where it is; give plane_point and plane_normal, or centre and radius_mm")
    for condition in conditions:
        chosen &= True if condition is None else condition
    if not chosen.any():
        edge = float(np.sqrt(areas(X).mean() * 4.0 / np.sqrt(3.0)))
        raise InputError(
            f"{where} lies on no face of the body, whose faces are about {edge:.2g} mm wide; look at where it is and at "
            "its size, or ask for more cells"
        )
    return np.asarray(faces[chosen], dtype=np.int64)


def _rim(mesh: TetMesh, patch: Patch) -> IntArray:
    """Boundary faces (r, 3) that the edge of a patch's disc cuts; none of a patch without a disc."""
    faces = mesh.boundary[0]
    if patch.centre is None or patch.radius_mm is None:
        return np.zeros((0, 3), dtype=np.int64)
    X = mesh.points[faces]
    inside = np.linalg.norm(X - np.array(patch.centre), axis=2) < patch.radius_mm
    plane = _on_plane(X, patch, patch.name)
    return np.asarray(
        faces[inside.any(axis=1) & ~inside.all(axis=1) & (True if plane is None else plane)], dtype=np.int64
    )


def _on_plane(X: FloatArray, patch: Patch, where: str) -> BoolArray | None:
    if patch.plane_point is None and patch.plane_normal is None:
        return None
    if patch.plane_point is None or patch.plane_normal is None:
        raise InputError(f"{where} has half of a plane; give both plane_point and plane_normal")
    normal = np.array(patch.plane_normal)
    if not np.abs(normal).max() > 0.0:
        raise InputError(
            f"{where}: plane_normal is {list(patch.plane_normal)} and has no length; give the plane's direction"
        )
    normal = normal / np.abs(normal).max()
    distance = (X - np.array(patch.plane_point)) @ (normal / np.linalg.norm(normal))
    return np.asarray((np.abs(distance) < patch.tolerance_mm).all(axis=1))


def _within(X: FloatArray, patch: Patch, where: str) -> BoolArray | None:
    if patch.centre is None and patch.radius_mm is None:
        return None
    if patch.centre is None or patch.radius_mm is None:
        raise InputError(f"{where} has half of a disc; give both centre and radius_mm")
    return np.asarray(np.linalg.norm(X.mean(axis=1) - np.array(patch.centre), axis=1) < patch.radius_mm)


def _facts(moved: MovedPatch, name: str, state: int, where: str) -> PatchFacts:
    if all(value is None for value in moved.displacement_mm):
        raise InputError(f"{where}: displacement_mm prescribes nothing; give a number along one axis at least")
    x, y, z = (sd or 0.0 for sd in by_axis(moved.displacement_sd_mm, f"{where}: displacement_sd_mm", -1e-30))
    force, stated_error = moved.reaction_n or NO_AXIS, moved.reaction_sd_n
    errors = NO_AXIS if stated_error is None else by_axis(stated_error, f"{where}: reaction_sd_n")
    for axis, value, stated, displacement in zip(_ALL_AXES, force, errors, moved.displacement_mm, strict=True):
        if value is not None and stated is None:
            raise InputError(f"{where}: reaction_n has a force along {axis} without an error; give reaction_sd_n, in N")
        if value is not None and displacement is None:
            raise InputError(
                f"{where}: reaction_n has a force along {axis}, where the patch is free; give displacement_mm"
            )
    return PatchFacts(name, moved.displacement_mm, (x, y, z), force, errors, state)


def _name(patch: Patch, index: int) -> str:
    return patch.name or str(index + 1)


def _rigid(mesh: TetMesh, faces: IntArray, axes: Sequence[int]) -> FloatArray:
    """Motion (k, 6) of the faces' corners along axes by the six rigid motions, turns counted at the body's edge."""
    centre = mesh.points.mean(axis=0)
    size = max(float(np.linalg.norm(mesh.points - centre, axis=1).max()), 1e-30)
    X = (mesh.points[np.unique(faces)] - centre) / size
    out = [np.hstack([np.tile(np.eye(3)[i], (len(X), 1)), np.cross(X, np.eye(3)[i])]) for i in axes]
    return np.vstack([np.zeros((0, 6)), *out])


def _words(motion: FloatArray) -> str:
    """What a rigid motion (6,) does, by its largest part."""
    k = int(np.argmax(np.abs(motion)))
    return f"{'slide along' if k < 3 else 'turn about'} {_ALL_AXES[k % 3]}"
