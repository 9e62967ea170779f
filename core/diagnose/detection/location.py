"""Location of a gap: standardised residual on the organ, and the smallest field of forces that would close it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.diagnosis_record import RegionGapRecord
from palpate.core.inference.evidence import projected
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.motion_rows import motion_in_mm
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_covariance import organ_errors
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.unknown_field import ForceFields, UnknownDiscrepancy

_SIDES = (("right", "left"), ("anterior", "posterior"), ("inferior", "superior"))


@dataclass(frozen=True, eq=False)
class DiscrepancyMaps:
    """Maps of the discrepancy of one deformed state: on the organ's surface, and of missing forces around it.

    points (q, 3) mm, normals (q, 3), region (q,) : of the organ's surface at rest. residual (q,) mm : along the normal,
    predicted minus observed, without noise finer than the surface modes. standardised (q,) : residual over its standard
    deviation under the noise, without unit. nodes (k, 3) mm : of the mesh near the organ. force (k, 3) kPa/mm :
    estimated missing force density there. peak (3,) mm : place of the largest missing force, None when there is none.
    blur_mm : how far a point force spreads in that map, mm.
    """

    points: FloatArray
    normals: FloatArray
    region: IntArray
    residual: FloatArray
    standardised: FloatArray
    nodes: FloatArray
    force: FloatArray
    peak: FloatArray | None
    blur_mm: float


def discrepancy_maps(fit: PlainFit, free: UnknownDiscrepancy, rules: DecisionRules, state: int = 0) -> DiscrepancyMaps:
    """Maps of one deformed state at the plain fit, from that state's data."""
    data, linearisation, forces, rows = (
        fit.model.each[state].data,
        fit.linearisation.each[state],
        free.each[state],
        fit.model.rows[state],
    )
    weighting = Weighting(fit.weighting.covariance[rows, rows])
    observation = linearisation.scene.observation
    k = data.n_modes
    smooth = _on_the_organ(data, linearisation)
    sd = _sd_on_the_organ(data, linearisation, weighting.covariance[:k, :k])
    r, J = weighting.whiten(linearisation.residual), weighting.whiten(linearisation.in_theta)
    R = projected(J, weighting.whiten(forces.response))
    inverse = np.linalg.solve(R.T @ R + np.eye(R.shape[1]), R.T)
    density = forces.force_density(-inverse @ projected(J, r))
    size = np.linalg.norm(density, axis=1)
    near = np.flatnonzero(size > 1e-12 * max(size.max(), 1e-30))
    nodes = linearisation.scene.space.nodes[near] - linearisation.scene.shift[near]
    peak = _peak(nodes, size[near], observation.points, fit.options.force_length_mm, rules)
    blur = _blur(forces, inverse @ R, nodes, near, peak)
    return DiscrepancyMaps(
        observation.points,
        observation.normals,
        observation.region,
        smooth,
        smooth / np.where(sd > 0.0, sd, 1.0),
        nodes,
        density[near],
        peak,
        blur,
    )


def residuals(fit: PlainFit) -> list[FloatArray]:
    """Residuals (q,) mm of the plain model on the organ's surface, for each deformed state, smoothed like contour
    noise; where nobody drew the organ there, against the surface that the images put in its place."""
    each = zip(fit.model.data_vectors, fit.linearisation.each, strict=True)
    return [_on_the_organ(data, linearisation) for data, linearisation in each]


@dataclass(frozen=True, eq=False)
class MotionGap:
    """Predicted minus matched motion where the images of one state show it: places (w, 3) mm at rest, missed (w, 3) mm, and the same over
    its standard deviation, without unit. No rows without images."""

    places: FloatArray
    missed: FloatArray
    standardised: FloatArray

    @classmethod
    def of(cls, fit: PlainFit, state: int = 0) -> MotionGap:
        """At the plain fit, smooth as the matching takes motion to be."""
        data, at, rows = fit.model.data_vectors[state], fit.linearisation.each[state], fit.model.rows[state]
        if not data.n_motion:
            return cls(*(np.zeros((0, 3)) for _ in range(3)))
        seen = at.scene.observation.motion
        read = motion_in_mm(seen.rows, seen.reader)
        covariance = fit.weighting.covariance[rows, rows][data.motion, data.motion]
        sd = np.sqrt(np.einsum("wai,ij,waj->wa", read, covariance, read, optimize=True))
        missed = read @ at.residual[data.motion]
        return cls(seen.rows.places, missed, missed / np.where(sd > 0.0, sd, 1.0))


def _on_the_organ(data: DataVector, linearisation: Linearisation) -> FloatArray:
    if data.n_modes:
        return data.modes @ linearisation.residual[: data.n_modes]
    scene = linearisation.scene
    return scene.observation.residual_and_normal(scene.seen(linearisation.equilibrium.u))[0]


def _sd_on_the_organ(data: DataVector, linearisation: Linearisation, covariance: FloatArray) -> FloatArray:
    """Standard deviations (q,) mm of these residuals. covariance (k, k) : of the data's surface modes."""
    if data.n_modes:
        return np.sqrt(np.einsum("qi,ij,qj->q", data.modes, covariance, data.modes))
    errors = organ_errors(linearisation.scene, linearisation.equilibrium.u)
    return np.hypot(errors.rest, errors.deformed)


def regions(maps: DiscrepancyMaps, names: dict[int, str]) -> list[RegionGapRecord]:
    """Residual by organ region and by side: rms in mm and share of the sum of squares."""
    centre = maps.points.mean(axis=0)
    total = max(float((maps.residual**2).sum()), 1e-30)
    out = []
    for region, name in names.items():
        out.append(_row(maps, maps.region == region, name, "all", total))
    for axis, (low, high) in enumerate(_SIDES):
        above = maps.points[:, axis] > centre[axis]
        out.append(_row(maps, ~above, "organ", low, total))
        out.append(_row(maps, above, "organ", high, total))
    return out


def _row(maps: DiscrepancyMaps, part: BoolArray, name: str, side: str, total: float) -> RegionGapRecord:
    squares = maps.residual[part] ** 2
    rms = float(np.sqrt(squares.mean())) if part.any() else 0.0
    return RegionGapRecord(name, side, rms, float(squares.sum()) / total)


def _peak(
    nodes: FloatArray, size: FloatArray, organ: FloatArray, length_mm: float, rules: DecisionRules
) -> FloatArray | None:
    """Centre (3,) mm of the largest forces near the organ, of those within their correlation length; None where there are none."""
    if len(nodes) == 0 or size.max() <= 0.0:
        return None
    close = cKDTree(organ).query(nodes)[0] < rules.near_mm
    least = rules.peak_share * size[close].max(initial=0.0)
    weight = np.where(close & (size > least), size, 0.0)
    top = nodes[int(np.argmax(weight))]
    weight = weight * (np.linalg.norm(nodes - top, axis=1) < length_mm)
    return np.asarray(np.average(nodes, axis=0, weights=weight)) if weight.any() else None


def _blur(
    forces: ForceFields, resolution: FloatArray, nodes: FloatArray, near: IntArray, peak: FloatArray | None
) -> float:
    """Point spread: rms radius, mm, of the map of a force that acts at the peak alone."""
    if peak is None:
        return 0.0
    at = near[int(np.argmin(np.linalg.norm(nodes - peak, axis=1)))]
    spread = np.zeros(len(near))
    for axis in range(3):
        shown = np.einsum("k,kni->ni", resolution @ forces.fields[:, at, axis], forces.fields[:, near])
        spread += ((shown / forces.share[near, None]) ** 2).sum(axis=1)
    spread *= forces.share[near]
    distance = np.linalg.norm(nodes - peak, axis=1)
    return float(np.sqrt((spread * distance**2).sum() / max(spread.sum(), 1e-30)))
