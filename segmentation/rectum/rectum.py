"""The rectum: gas, stool and wall, as one tube."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.statistics import rms
from palpate.segmentation.methods.optimal_surface import crossing, optimal_surface, region_cost
from palpate.segmentation.methods.subvoxel_edges import mask_to_edges
from palpate.segmentation.methods.surface_mesh import Shell
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.rectum import outlines
from palpate.segmentation.rectum.course import course_of
from palpate.segmentation.rectum.gas_sections import about_gas
from palpate.segmentation.rectum.guide import guide_of
from palpate.segmentation.rectum.outlines import ANGLES, RADII, RADIUS_STEP, UNIT, Track
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import Mask, blurred

ALONG_STIFFNESS = 0.35
# Rounds of drawing, and over how many slices a course is smoothed first.
ROUNDS, ALONG_SLICES = 2, 1.5
PRIOR_WEIGHT, GUIDE_WEIGHT = 0.02, 0.1
# Gas lies at the front of a lumen: beside these directions (LPS, y backwards) nothing but wall is beyond it.
FRONT = 0.5
SNAP_MM = 2.0
# The canal's radius at its lower end, and by how much it opens per mm above: the levator's funnel. Room about given points.
CANAL_MM, OPENS, BOX_MM = 9.0, 0.4, 0.5
# The same about an end that is a rule's: the canal may begin above it.
RULED_OPENS = 0.2
# How far an end may be off, mm: one that a person gave, and one by the rule of heights about the symphysis.
GIVEN_MM, RULED_MM = 4.0, 15.0


def find_rectum(scene: Scene, prompts: Prompts, bladder: Mask | None) -> Found | None:
    """The rectum with its wall, from the anal canal to the sigmoid; None where nothing like it is there."""
    avoid = scene.bone if bladder is None else scene.bone | bladder
    points = prompts.extremes.get("rectum")
    if points is not None:
        return _within_points(scene, prompts, avoid, points)
    ends = _ends(scene, prompts)
    course = course_of(scene, avoid, ends, prompts.point("rectum"))
    if course is None:
        return None
    path, inside = _drawn(scene, avoid, course, ends[0])
    box = prompts.box("rectum")
    if box is None:
        mask = mask_to_edges(scene.soft_tissue, scene.fat_edge, _tube(path).voxels(scene.grid), SNAP_MM) & ~avoid
    else:
        mask = _tube(_tapered(path, float(box[0, 2]))).voxels(scene.grid) & ~avoid & scene.box_mask(box, BOX_MM)
    return Found(mask, prompts.mode("rectum"), _confidence(path, inside, ends_given=box is not None))


def _drawn(scene: Scene, avoid: Mask, course: Track, lowest: float) -> tuple[Track, Mask]:
    """The outlines about a course as one surface; and the radii at which fat or gas speak for them.

    Below the middle of the symphysis levator and sphincter lie about the rectum and look the same: its size is told by its gas and
    by the course there, not by where fat begins.
    """
    low = course.z < scene.pelvis.symphysis[1, 2]
    above = float(np.median(course.radii[~low])) if (~low).any() else outlines.USUAL_MM
    radii = np.where(low[:, None], np.minimum(course.radii, above), course.radii)
    radii = ndimage.gaussian_filter1d(radii, ALONG_SLICES, axis=0, mode="nearest")
    centres = ndimage.gaussian_filter1d(course.centres, ALONG_SLICES, axis=0, mode="nearest")
    path = about_gas(scene, _tapered(Track(course.z, centres, radii), lowest, RULED_OPENS))
    expected = path.radii.ravel()
    weight = np.repeat(np.where(low, GUIDE_WEIGHT, PRIOR_WEIGHT), ANGLES)
    front = np.tile(UNIT[:, 1] < FRONT, len(course.z))
    for _ in range(ROUNDS):
        section = _sections(scene, avoid, path)
        inside, gas_radius = outlines.evidence(*section, scene.fat_edge)
        hoped = np.where((gas_radius > 0.0) & front, gas_radius, np.maximum(expected, gas_radius))
        cost = region_cost(inside) + outlines.prior_cost(hoped, 1.0) * weight[:, None]
        path, near = _surface(scene, path, section[0], cost)
        spoken = near | (gas_radius > 0.0)
        path = _recentred(path)
    return path, spoken


def _recentred(path: Track) -> Track:
    """The same outlines as seen from the middle of each, the middles in a smooth line."""
    points = [path.centres[k] + path.radii[k][:, None] * UNIT for k in range(len(path.z))]
    middles = np.array([outlines.centroid(outline) for outline in points])
    middles = ndimage.gaussian_filter1d(middles, 1.0, axis=0, mode="nearest")
    return Track(
        path.z, middles, np.array([outlines.about(outline, at) for outline, at in zip(points, middles, strict=True)])
    )


def _within_points(scene: Scene, prompts: Prompts, avoid: Mask, points: FloatArray) -> Found | None:
    """The rectum about the line that its six outermost points (6, 3) mm give: no following, which may run into another loop."""
    low, high = _ends(scene, prompts)
    heights = np.arange(low + 0.5 * scene.step, high, 2.0 * scene.step)
    if len(heights) < 4:
        return None
    guide = guide_of(points, heights)
    section = _sections(scene, avoid, guide)
    inside, gas_radius = outlines.evidence(*section, scene.fat_edge)
    expected = guide.radii.ravel()
    front = np.tile(UNIT[:, 1] < FRONT, len(heights))
    expected = np.where((gas_radius > 0.0) & front, gas_radius, np.maximum(expected, gas_radius))
    path, near = _surface(scene, guide, section[0], region_cost(inside) + outlines.prior_cost(expected, GUIDE_WEIGHT))
    shell = _tube(_tapered(path, float(points[:, 2].min())))
    mask = shell.voxels(scene.grid) & ~avoid & scene.box_mask(np.array([points.min(0), points.max(0)]), BOX_MM)
    return Found(mask, "extremes", _confidence(path, near | (gas_radius > 0.0), ends_given=True))


def _ends(scene: Scene, prompts: Prompts) -> tuple[float, float]:
    box, front = prompts.box("rectum"), scene.pelvis.symphysis
    low, high = (front[0, 2] - outlines.BELOW_MM, front[1, 2] + outlines.ABOVE_MM) if box is None else box[:, 2]
    z = scene.axes()[2].ravel()
    return max(float(low), float(z[0])), min(float(high), float(z[-1]))


def _sections(scene: Scene, avoid: Mask, path: Track) -> tuple[FloatArray, FloatArray, FloatArray]:
    """HU with gas as soft tissue, HU, and what is blocked, each (n, m) along the rays of all outlines."""
    soft = blurred(scene.filled, 0.8, scene.step)
    at = path.centres, path.z
    blocked = avoid.astype(np.float32)
    return (
        outlines.sampled(scene, soft, *at),
        outlines.sampled(scene, scene.hu, *at),
        outlines.sampled(scene, blocked, *at),
    )


def _surface(scene: Scene, path: Track, soft: FloatArray, cost: FloatArray) -> tuple[Track, Mask]:
    """The surface of least cost (n, m) about a track's centres, edges against fat gained by `soft` (n, m); and where it
    ends at one (n,)."""
    count = len(path.z)
    cost = cost - outlines.EDGE_WEIGHT * outlines.soft_edge(soft, scene)
    index = optimal_surface(cost, _grid_edges(count), 2, ALONG_STIFFNESS)
    near = crossing(soft, index, scene.fat_edge, 2)
    radii = RADII[0] + RADIUS_STEP * np.where(np.isfinite(near), near, index + 0.5)
    return Track(path.z, path.centres, radii.reshape(count, ANGLES)), np.isfinite(near)


def _tapered(path: Track, lowest: float, opens: float = OPENS) -> Track:
    """The outlines without the sphincter and levator about the anal canal, which look the same: lowest is the end given."""
    most = CANAL_MM + opens * np.maximum(path.z - lowest, 0.0)
    return Track(path.z, path.centres, np.minimum(path.radii, most[:, None]))


def _grid_edges(count: int) -> IntArray:
    node = np.arange(count * ANGLES).reshape(count, ANGLES)
    around = np.stack([node, np.roll(node, -1, axis=1)], axis=-1).reshape(-1, 2)
    along = np.stack([node[:-1], node[1:]], axis=-1).reshape(-1, 2)
    return np.concatenate([around, along])


def _tube(path: Track) -> Shell:
    """A closed tube through the outlines, with flat ends half a slice beyond the last ones."""
    count = len(path.z)
    ring = path.centres[:, None, :] + path.radii[:, :, None] * UNIT[None]
    half = 0.5 * float(np.diff(path.z).mean())
    ring = np.concatenate([ring[:1], ring, ring[-1:]])
    z = np.concatenate([[path.z[0] - half], path.z, [path.z[-1] + half]])
    points = np.concatenate([ring, np.broadcast_to(z[:, None, None], (*ring.shape[:2], 1))], axis=2).reshape(-1, 3)
    ends = np.array([[*path.centres[0], z[0]], [*path.centres[-1], z[-1]]])
    node = np.arange((count + 2) * ANGLES).reshape(count + 2, ANGLES)
    after = np.roll(node, -1, axis=1)
    a, b, c, d = node[:-1].ravel(), after[:-1].ravel(), after[1:].ravel(), node[1:].ravel()
    bottom = np.column_stack([np.full(ANGLES, len(points)), after[0], node[0]])
    top = np.column_stack([np.full(ANGLES, len(points) + 1), node[-1], after[-1]])
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
    return Shell(np.concatenate([points, ends]), faces)


def _confidence(path: Track, spoken: Mask, ends_given: bool) -> float:
    """From length, the share of the wall that fat or gas shows, size, and how much of it hangs on where its ends are.

    No edge shows where the anal canal or the sigmoid begins: ends that nobody gave are a rule's. What lies within the
    rule's error is as likely in as out, which costs half its share of the volume in expected overlap.
    """
    length = np.clip((path.z[-1] - path.z[0] - 20.0) / 40.0, 0.0, 1.0)
    width = rms(path.radii)
    size = np.exp(-0.5 * (np.log(width / 14.0) / 0.5) ** 2)
    area = (path.radii**2).mean(axis=1)
    doubt = GIVEN_MM if ends_given else RULED_MM
    at_ends = (path.z < path.z[0] + doubt) | (path.z > path.z[-1] - doubt)
    ends = 1.0 - 0.5 * float(area[at_ends].sum() / area.sum())
    return round(float(length * size * ends * np.clip((spoken.mean() - 0.2) / 0.5, 0.0, 1.0)), 3)
