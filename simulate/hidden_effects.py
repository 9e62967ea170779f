"""What a simulation hides from an analysis: places whose stiffness is not that of their region.

None is written as the diagnosis has it: edges are sharp, and an organ slides by a soft layer around it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.fem.materials import Material
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.imaging.labels import LABELS, ORGAN_LABELS, SURROUNDING_TISSUE


class HiddenEffect(Protocol):
    """Of one kind, at one place."""

    def factors(self, mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
        """By what shear and bulk modulus of every cell are multiplied, (m,) each. Raises InputError where it meets no cell."""


@dataclass(frozen=True)
class Inclusion:
    """A stiff or soft ball inside one half.

    label : of the half. offset_mm : from its centroid, LPS. factor : of all moduli.
    """

    label: int
    offset_mm: tuple[float, float, float]
    radius_mm: float
    factor: float

    def factors(self, mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
        """See `HiddenEffect`."""
        centres, half = _centres(mesh), mesh.regions == self.label
        middle = np.average(centres[half], axis=0, weights=mesh.volumes[half])
        inside = half & (np.linalg.norm(centres - middle - np.array(self.offset_mm), axis=1) < self.radius_mm)
        _require(inside, f"inclusion: no cell of {LABELS[self.label]} lies in it; change offset_mm or radius_mm")
        both = np.where(inside, self.factor, 1.0)
        return both, both


@dataclass(frozen=True)
class UnevenTissue:
    """Surrounding tissue that is stiffer or softer beyond a plane.

    towards : (3,) LPS, out of the organ. from_mm : how far from the organ's centroid the plane lies. factor : of all moduli.
    """

    towards: tuple[float, float, float]
    from_mm: float
    factor: float

    def factors(self, mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
        """See `HiddenEffect`."""
        centres, organ = _centres(mesh), np.isin(mesh.regions, ORGAN_LABELS)
        middle = np.average(centres[organ], axis=0, weights=mesh.volumes[organ])
        axis = np.array(self.towards) / np.linalg.norm(self.towards)
        beyond = (mesh.regions == SURROUNDING_TISSUE) & ((centres - middle) @ axis > self.from_mm)
        _require(beyond, "tissue_heterogeneity: no tissue lies beyond the plane; change towards or from_mm")
        both = np.where(beyond, self.factor, 1.0)
        return both, both


@dataclass(frozen=True)
class SlidingOrgan:
    """A layer of tissue around the organ that shears easily.

    layer_mm : cells whose middle lies so near to the organ are in it. softer : how many times; they keep their bulk modulus.
    Cells at the mesh's edge stay as they are: tissue slides along a wall anyway, and a soft cell between organ and wall holds neither.
    """

    layer_mm: float
    softer: float

    def factors(self, mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
        """See `HiddenEffect`."""
        surface = TriangleTree.of(mesh.points, mesh.region_boundary(ORGAN_LABELS)[0])
        near = closest_points(surface, _centres(mesh)).distance < self.layer_mm
        at_edge = np.isin(mesh.cells, np.unique(mesh.boundary[0])).any(axis=1)
        layer = near & (mesh.regions == SURROUNDING_TISSUE) & ~at_edge
        _require(
            layer,
            "interface_sliding: no cell lies so near to the organ and away from walls and bone; give a larger layer_mm",
        )
        return np.where(layer, 1.0 / self.softer, 1.0), np.ones(len(mesh.cells))


@dataclass(frozen=True)
class Capsule:
    """A stiff or soft rind of the organ, for which the diagnosis has no name.

    thickness_mm : cells of the organ whose middle lies so near to its surface are in it. factor : of all moduli.
    """

    thickness_mm: float
    factor: float

    def factors(self, mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
        """See `HiddenEffect`."""
        surface = TriangleTree.of(mesh.points, mesh.region_boundary(ORGAN_LABELS)[0])
        near = closest_points(surface, _centres(mesh)).distance < self.thickness_mm
        rind = near & np.isin(mesh.regions, ORGAN_LABELS)
        _require(rind, "capsule: no cell of the organ lies so near to its surface; give a larger thickness_mm")
        both = np.where(rind, self.factor, 1.0)
        return both, both


def with_effects(
    mesh: TetMesh, materials: Mapping[int, Material], hidden: Sequence[HiddenEffect]
) -> dict[int, Material]:
    """Materials by region with all effects in them, a value for every cell. The very same where nothing is hidden."""
    out = dict(materials)
    for effect in hidden:
        shear, bulk = effect.factors(mesh)
        for region, material in out.items():
            here = mesh.regions == region
            values = material.per_cell(int(here.sum()))
            # the last parameter of both laws is the bulk modulus, or half of it
            by = np.column_stack([*[shear[here]] * (values.shape[1] - 1), bulk[here]])
            out[region] = Material(material.law, values * by)
    return out


def _centres(mesh: TetMesh) -> FloatArray:
    return np.asarray(mesh.points[mesh.cells].mean(axis=1))


def _require(cells: BoolArray, otherwise: str) -> None:
    if not cells.any():
        raise InputError(f"simulation spec: hidden.{otherwise}")
