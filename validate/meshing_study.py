"""Meshes of contoured scans: angles, volumes, distance from the contours, thin tissue, seconds.

How far a surface lies from its label's voxels is told in voxels (each axis by its own edge) and in mm. No smooth
surface lies within half the smallest edge of slices three times as thick: beside each mesh stands what the smooth
surface itself reaches.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import NotRequired, TypedDict

import numpy as np
from scipy import ndimage

from palpate.case.contours import contours_of_volume
from palpate.case.steps.segment import labels_of
from palpate.case.steps.segment_options import SegmentOptions
from palpate.case.steps.segment_report import SegmentedState
from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL
from palpate.core.surfaces.triangles import areas
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions, mesh_labels
from palpate.meshing.quality import SLIVER_DEG
from palpate.segmentation.pelvis import segment_pelvis
from palpate.segmentation.prostate.halves import midline_normal, split_plane
from palpate.segmentation.tissue import region_of_interest
from palpate.validate.segmentation.contoured_scan import ContouredScan

WANTED_ANGLE_DEG, WANTED_VOLUME, WANTED_VOXELS, WANTED_SECONDS = SLIVER_DEG, 0.02, 0.5, 60.0
# Voxels are split to about this for distances from their outline.
FINE_MM = 0.5
# Points of each face at which its distance is measured, in corner weights.
_INNER = np.vstack([np.full((1, 3), 1.0 / 3.0), 0.2 + 0.4 * np.eye(3)])


class LabelsAndMesh(TypedDict):
    """One figure of both."""

    labels: float
    mesh: float


class Checks(TypedDict):
    """What is as wanted."""

    angle: bool
    volume: bool
    surface: bool
    seconds: bool


class MeshRow(TypedDict):
    """One mesh: its cells, its volumes against the labels', distances of its organ surface from the outline of the
    voxels.
    """

    scan: str
    cells: int
    min_dihedral_deg: float
    slivers: int
    worst_volume_error: float
    volume_error: dict[str, float]
    surface_p95_mm: float
    surface_p95_voxels: float
    surface_share_within_half_smallest_edge: float
    smooth_outline_p95_mm: float
    smooth_outline_share_within_half_smallest_edge: float
    half_voxel_mm: float
    smooth_surface_p95_mm: dict[str, float]
    organ_on_rectum_mm2: LabelsAndMesh
    attempts: int
    seconds: float
    cpu_seconds: NotRequired[float]
    checks: Checks
    reached: bool


class MeshingTable(TypedDict):
    """A row a scan, and how many reach all that is wanted."""

    rows: list[MeshRow]
    target_tets: int
    reached: int


def meshing_study(
    scans: Sequence[ContouredScan], options: MeshOptions | None = None, progress: Progress = silent
) -> MeshingTable:
    """One row a scan, beside what is wanted; JSON-able. Raises InputError when a scan cannot be meshed."""
    options = options or MeshOptions()
    rows: list[MeshRow] = []
    for number, scan in enumerate(scans):
        progress(number / len(scans), f"{scan.name}: labels")
        labels = labels_of_scan(scan)
        progress((number + 0.3) / len(scans), f"{scan.name}: mesh")
        start, worked = time.perf_counter(), _cpu_seconds()
        meshed = mesh_labels(labels, options)
        row = row_of(scan.name, labels, meshed, time.perf_counter() - start)
        rows.append({**row, "cpu_seconds": _cpu_seconds() - worked})
    return {"rows": rows, "target_tets": options.target_tets, "reached": sum(row["reached"] for row in rows)}


def _cpu_seconds() -> float:
    """Processor time so far, that of the mesher's process included: what the clock would say on a machine with no other
    work.
    """
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def labels_of_scan(scan: ContouredScan) -> Volume:
    """The labels of the modelled region: what was drawn, bone and tissue found."""
    drawn = contours_of_volume(scan.labels)
    segmentation = segment_pelvis(scan.ct, drawn=drawn.organs)
    part = SegmentedState(segmentation, drawn, drawn.volume)
    normal, source = midline_normal(segmentation.scene.pelvis)
    box = region_of_interest(part.prostate, np.array(SegmentOptions().margin_mm))
    return labels_of(part, split_plane(part.prostate, normal, source, None), box)


def row_of(name: str, labels: Volume, meshed: MeshedCase, seconds: float) -> MeshRow:
    """The figures of one mesh, and whether each is as wanted."""
    quality = meshed.quality
    voxel_mm = float(labels.spacing.mean())
    worst = max(abs(region["volume_error"]) for region in quality["regions"].values())
    on_mesh = points_on_organ(meshed)
    away = np.abs(distance_from_outline(labels, on_mesh))
    in_voxels = float(np.percentile(np.abs(distance_from_outline(labels, on_mesh, in_voxels=True)), 95))
    smooth = np.abs(distance_from_outline(labels, organ_surfaces(labels).points))
    p95 = float(np.percentile(away, 95))
    touching = contact_of_labels(labels), contact_of_mesh(meshed)
    checks: Checks = {
        "angle": quality["min_dihedral_deg"] >= WANTED_ANGLE_DEG,
        "volume": worst <= WANTED_VOLUME,
        "surface": p95 <= WANTED_VOXELS * voxel_mm and in_voxels <= WANTED_VOXELS,
        "seconds": seconds <= WANTED_SECONDS,
    }
    return {
        "scan": name,
        "cells": quality["cells"],
        "min_dihedral_deg": quality["min_dihedral_deg"],
        "slivers": quality["slivers"],
        "worst_volume_error": worst,
        "volume_error": {region: figures["volume_error"] for region, figures in quality["regions"].items()},
        "surface_p95_mm": p95,
        "surface_p95_voxels": in_voxels,
        "surface_share_within_half_smallest_edge": float((away <= 0.5 * labels.spacing.min()).mean()),
        "smooth_outline_p95_mm": float(np.percentile(smooth, 95)),
        "smooth_outline_share_within_half_smallest_edge": float((smooth <= 0.5 * labels.spacing.min()).mean()),
        "half_voxel_mm": WANTED_VOXELS * voxel_mm,
        "smooth_surface_p95_mm": {key: surface["p95_mm"] for key, surface in quality["surfaces"].items()},
        "organ_on_rectum_mm2": {"labels": touching[0], "mesh": touching[1]},
        "attempts": quality["attempts"],
        "seconds": seconds,
        "checks": checks,
        "reached": all(checks.values()),
    }


def points_on_organ(meshed: MeshedCase) -> FloatArray:
    """Points (4 f, 3) mm on the mesh's organ surface, four inside each face."""
    return np.einsum("wc,fck->fwk", _INNER, meshed.mesh.points[_organ_faces(meshed)]).reshape(-1, 3)


def distance_from_outline(labels: Volume, points: FloatArray, in_voxels: bool = False) -> FloatArray:
    """Signed distance (n,) of points (n, 3) mm from the outline of the organ's voxels, in mm or in voxels."""
    index = labels.to_index(points)
    organ, first = _cropped(np.isin(labels.array, ORGAN_LABELS))
    # Voxels are split, so that distances between their centres are distances from their outline to a quarter of a mm.
    times = np.ceil(labels.spacing / FINE_MM).astype(int)
    fine = np.kron(organ, np.ones(times, dtype=bool)).astype(bool)
    step = (1.0 if in_voxels else labels.spacing) / times
    away = [ndimage.distance_transform_edt(m, sampling=step) for m in (~fine, fine)]
    signed = np.where(fine, 0.5 * step.mean() - away[1], away[0] - 0.5 * step.mean())
    at = (index - first + 0.5) * times - 0.5
    return np.asarray(ndimage.map_coordinates(signed, at.T, order=1, mode="nearest"))


def _cropped(mask: BoolArray) -> tuple[BoolArray, IntArray]:
    """The mask with four voxels about it, and the index of its first voxel in the whole."""
    wide = np.pad(mask, 4)
    part = ndimage.find_objects(wide.astype(np.uint8))[0]
    low = np.array([s.start - 4 for s in part])
    return wide[tuple(slice(s.start - 4, s.stop + 4) for s in part)], low - 4


def contact_of_mesh(meshed: MeshedCase) -> float:
    """Area, mm2, over which the organ lies on the rectum with no tissue between."""
    faces = meshed.boundary.get("rectum")
    if faces is None:
        return 0.0
    on_organ = np.isin(faces, np.unique(_organ_cells(meshed))).all(axis=1)
    return float(areas(meshed.mesh.points[faces[on_organ]]).sum())


def contact_of_labels(labels: Volume) -> float:
    """The same of the voxels: the area of faces shared by organ and rectum."""
    organ, rectum = np.isin(labels.array, ORGAN_LABELS), labels.array == RECTUM
    area, total = float(np.prod(labels.spacing)), 0.0
    for axis in range(3):
        first, second = [slice(None)] * 3, [slice(None)] * 3
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        a, b = tuple(first), tuple(second)
        total += float(((organ[a] & rectum[b]) | (rectum[a] & organ[b])).sum()) * area / float(labels.spacing[axis])
    return total


def study_text(found: MeshingTable) -> str:
    """The table for a person."""
    lines = [f"{'scan':10}{'cells':>7}{'angle':>8}{'slivers':>9}{'volume %':>10}{'p95 mm':>8}{'(smooth)':>10}{'voxels':>8}"
             f"{'on rectum mm2 (labels)':>25}{'s':>6}{'cpu s':>7}"]  # fmt: skip
    for row in found["rows"]:
        contact = f"{row['organ_on_rectum_mm2']['mesh']:.0f} ({row['organ_on_rectum_mm2']['labels']:.0f})"
        missed = [key for key, good in row["checks"].items() if not good]
        away = f"{row['surface_p95_mm']:8.2f}{row['smooth_outline_p95_mm']:10.2f}{row['surface_p95_voxels']:8.2f}"
        lines.append(
            f"{row['scan']:10}{row['cells']:7}{row['min_dihedral_deg']:8.1f}{row['slivers']:9}"
            f"{100 * row['worst_volume_error']:10.2f}{away}"
            f"{contact:>25}{row['seconds']:6.0f}{row.get('cpu_seconds', np.nan):7.0f}"
            + (f"  not reached: {', '.join(missed)}" if missed else "")
        )
    return "\n".join(lines)


def _organ_cells(meshed: MeshedCase) -> IntArray:
    return np.asarray(meshed.mesh.cells[np.isin(meshed.mesh.regions, ORGAN_LABELS)])


def _organ_faces(meshed: MeshedCase) -> IntArray:
    """Faces (f, 3) of the organ that no two of its cells share."""
    faces = _organ_cells(meshed)[:, FACES_OF_CELL].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[count == 1]])
