"""What gas says of the lumen that it is in: it rises to the front, and is as wide as the lumen where it ends below."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.segmentation.rectum.outlines import UNIT, WALL_MM, Track
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask

# What lies in front of a section of gas, beyond its wall and so far, is no lumen. Smaller sections are bubbles in stool.
FRONT_MM, BUBBLE_MM2 = 30.0, 150.0

# A rectum that gas does not fill is less deep than wide, by this factor.
FLATTENED = 0.8


def large_gas(gas: Mask, step: float) -> Mask:
    """Gas (i, j, k) but for bubbles, slice by slice."""
    out = np.zeros(gas.shape, dtype=bool)
    for k in np.flatnonzero(gas.any(axis=(0, 1))):
        parts, count = ndimage.label(gas[:, :, k])
        sizes = np.bincount(parts.ravel(), minlength=count + 1) * step**2
        sizes[0] = 0.0
        out[:, :, k] = sizes[parts] >= BUBBLE_MM2
    return out


def in_front_of_gas(scene: Scene, gas: Mask) -> Mask:
    """What lies in front of the gas of each slice, beyond its wall."""
    out = np.zeros(gas.shape, dtype=bool)
    wall, far = int(np.ceil((WALL_MM + 1.0) / scene.step)), round(FRONT_MM / scene.step)
    for i, k in np.argwhere(gas.any(axis=1)):
        top = int(gas[i, :, k].argmax())
        out[i, max(0, top - far) : max(0, top - wall), k] = True
    return out


def about_gas(scene: Scene, path: Track) -> Track:
    """The outlines, wherever large gas lies within one, widened to the ellipse that touches the gas in
    front and holds its width."""
    gas = large_gas(scene.gas, scene.step)
    x, y = (scene.axes()[axis].ravel() for axis in range(2))
    centres, radii = path.centres.copy(), path.radii.copy()
    for k, (z, centre) in enumerate(zip(path.z, path.centres, strict=True)):
        layer = scene.index(np.array([*centre, z]))[2]
        parts, _ = ndimage.label(gas[:, :, layer])
        within = np.hypot(x[:, None] - centre[0], y[None, :] - centre[1]) < radii[k].mean()
        held = np.bincount(parts[within], minlength=1)
        held[0] = 0
        if not held.any():
            continue
        i, j = np.nonzero(parts == held.argmax())
        half = 0.5 * (x[i.max()] - x[i.min()] + scene.step) + WALL_MM
        if half > radii[k].mean():
            deep = FLATTENED * half
            radii[k] = half * deep / np.hypot(deep * UNIT[:, 0], half * UNIT[:, 1])
            centres[k] = 0.5 * (x[i.max()] + x[i.min()]), y[j.min()] - WALL_MM + deep
    return Track(path.z, centres, radii)
