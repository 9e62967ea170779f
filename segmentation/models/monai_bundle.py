"""A MONAI bundle that the user has: its TorchScript network run on a CT, without running anything else of the bundle.

A bundle is a folder with configs/metadata.json, configs/inference.json and models/. Its checkpoint (model.pt) is a pickle
and its configuration may hold Python expressions ("$..."): loading either runs whatever they say. So only TorchScript
(models/model.ts) is loaded, which can compute but not reach the machine, and of the configuration plain values are read.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import BoolArray, NumberArray
from palpate.core.errors import InputError
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import AIR_HU, bounds

_ORGANS = ("prostate", "bladder", "rectum")
# What loads, labels or converts, without changing a value: nothing to do here.
_PLAIN = ("LoadImage", "EnsureChannelFirst", "AddChannel", "EnsureType", "CastToType", "ToTensor", "ToDevice")
_FLIPS = {"RAS": (0, 1), "LPS": ()}
_MOST_VOXELS = 5e8


@dataclass(frozen=True)
class BundlePlan:
    """What is done to a CT before the network sees it. Spacing mm; ``window``: HU range and what it becomes; ``patch`` voxels."""

    spacing: tuple[float, ...] | None
    axes: str
    window: tuple[float, ...] | None
    patch: tuple[int, ...]
    overlap: float
    channels: Mapping[int, str]


def monai_masks(ct: Volume, folder: Path) -> dict[str, Volume]:
    """organ -> mask on the CT's grid, for the organs that the bundle's channels name.

    Raises InputError naming what is missing, cannot be read, or is more than this program does for a bundle.
    """
    plan = bundle_plan(folder)
    script = folder / "models" / "model.ts"
    if not script.is_file():
        raise InputError(f"{script} is not there: only TorchScript is run, never a pickle; make it with "
                         "python -m monai.bundle ckpt_export")  # fmt: skip
    try:
        import torch
        from monai.inferers import sliding_window_inference
    except ImportError as absent:
        raise InputError(
            f"--model monai: it cannot be loaded ({absent}); install it into this environment (pip install monai), or leave --model out"
        ) from absent
    picture = _prepared(ct, plan)
    try:
        network = torch.jit.load(str(script), map_location="cpu").eval()
        with torch.no_grad():
            given = torch.from_numpy(np.ascontiguousarray(_turned(picture.array, plan)[None, None]))
            answer = np.asarray(sliding_window_inference(given, plan.patch, 1, network, overlap=plan.overlap))
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{script} cannot be run ({str(error).splitlines()[0][:120]}); make it again") from error
    if answer.ndim != 5 or answer.shape[1] <= max(plan.channels):
        raise InputError(
            f"{script} answers with shape {answer.shape}; metadata.json names channel {max(plan.channels)}"
        )
    best = _turned(answer[0].argmax(axis=0), plan)
    masks = {organ: picture.with_array(best == channel) for channel, organ in plan.channels.items()}
    return {organ: ct.with_array(_on(mask, ct)) for organ, mask in masks.items() if mask.array.any()}


def bundle_plan(folder: Path) -> BundlePlan:
    """What a bundle's two JSON files ask for. Raises InputError as ``monai_masks`` does."""
    metadata, inference = (_read(folder / "configs" / name) for name in ("metadata.json", "inference.json"))
    steps = dict(_steps(inference))
    source = str(folder / "configs" / "inference.json")
    strange = sorted(set(steps) - {"Spacing", "Orientation", "ScaleIntensityRange", "SlidingWindowInferer", *_PLAIN})
    if strange:
        raise InputError(
            f"{source} asks for {strange[0]!r}, which is not done here; segment with MONAI and import the labels"
        )
    axes = str(steps.get("Orientation", {}).get("axcodes", "RAS"))
    if axes not in _FLIPS:
        raise InputError(f"{source} wants axes {axes!r}; only {' and '.join(_FLIPS)} are known")
    spacing = steps.get("Spacing", {}).get("pixdim")
    return BundlePlan(
        None if spacing is None else _numbers(spacing, 3, source),
        axes,
        _window(steps.get("ScaleIntensityRange"), source),
        *_patch(steps.get("SlidingWindowInferer", {}), source),
        _channels(metadata, folder / "configs" / "metadata.json"),
    )


def _window(step: Mapping[str, Any] | None, source: str) -> tuple[float, ...] | None:
    if step is None:
        return None
    window = _numbers([step.get(key) for key in ("a_min", "a_max", "b_min", "b_max")], 4, source)
    if step.get("clip") is not True or window[0] >= window[1]:
        raise InputError(
            f"{source} scales intensities without clip, or from nothing; only a clipped range is done here"
        )
    return window


def _patch(step: Mapping[str, Any], source: str) -> tuple[tuple[int, ...], float]:
    size = _numbers(step.get("roi_size", (96, 96, 96)), 3, source)
    overlap = _numbers([step.get("overlap", 0.25)], 1, source)[0]
    if not all(1.0 <= n <= 1024.0 for n in size) or not 0.0 <= overlap < 1.0:
        raise InputError(f"{source}: patches of {list(size)} voxels that overlap by {overlap:g} cannot be; correct it")
    return tuple(int(n) for n in size), overlap


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path} is not there; give --model monai:FOLDER with the folder of a MONAI bundle") from error
    except ValueError as error:
        raise InputError(f"{path} is not valid JSON; download the bundle again") from error
    if not isinstance(found, dict):
        raise InputError(f"{path} holds no JSON object; download the bundle again")
    return found


def _steps(inference: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The transforms before the network and the inferer by name, without module and the "d" of dictionary transforms."""
    before = inference.get("preprocessing")
    listed = before.get("transforms", ()) if isinstance(before, dict) else ()
    for step in (*(listed if isinstance(listed, list) else ()), inference.get("inferer")):
        if isinstance(step, dict) and not step.get("_disabled_"):
            name = str(step.get("_target_", "")).rsplit(".", 1)[-1]
            yield name.removesuffix("d"), {key: _literal(value, inference) for key, value in step.items()}


def _literal(value: Any, inference: Mapping[str, Any]) -> Any:
    """A plain value; that of "@name" where the file gives one. Expressions stay text, and are no numbers."""
    if isinstance(value, str) and value.startswith("@"):
        return inference.get(value[1:], value)
    return value


def _numbers(values: Any, count: int, source: str) -> tuple[float, ...]:
    good = isinstance(values, list | tuple) and len(values) == count
    if not good or not all(isinstance(v, int | float) and -1e9 < v < 1e9 for v in values):
        raise InputError(f"{source}: {values!r} is not {count} plain numbers; expressions are not evaluated")
    return tuple(float(v) for v in values)


def _channels(metadata: Mapping[str, Any], path: Path) -> dict[int, str]:
    """Channel -> organ. Raises InputError when none is an organ of ours."""
    found = metadata
    for key in ("network_data_format", "outputs", "pred", "channel_def"):
        found = found.get(key, {}) if isinstance(found, dict) else {}
    named = (
        {int(k): organ_of(str(v)) for k, v in found.items() if str(k).isdecimal()} if isinstance(found, dict) else {}
    )
    channels = {channel: organ for channel, organ in named.items() if organ in _ORGANS}
    if not channels or len(set(channels.values())) < len(channels):
        raise InputError(
            f"{path} names no channel, or two, for one of {', '.join(_ORGANS)}; give a bundle for the pelvis"
        )
    return {channel: str(organ) for channel, organ in channels.items()}


def _prepared(ct: Volume, plan: BundlePlan) -> Volume:
    """The CT on the bundle's grid, upright, as the network wants its values; float32."""
    low, high = bounds(ct)
    step = np.array(plan.spacing if plan.spacing is not None else np.sort(ct.spacing))
    size = np.ceil((high - low) / np.maximum(step, 1e-3)).astype(int)
    if step.min() < 0.1 or float(np.prod(size.astype(float))) > _MOST_VOXELS:
        raise InputError(
            f"the bundle's spacing {step.tolist()} mm makes {size.tolist()} voxels of this scan; it is too fine"
        )
    affine = np.diag([*step, 1.0])
    affine[:3, 3] = low + 0.5 * step
    grid = Volume(np.zeros(size, dtype=np.uint8), affine)
    image = sitk.Resample(
        sitk.Cast(ct.to_sitk(), sitk.sitkFloat32), grid.to_sitk(), sitk.Transform(), sitk.sitkLinear, AIR_HU
    )
    values = Volume.from_sitk(image).array
    if plan.window is not None:
        a, b, c, d = plan.window
        values = np.clip((values - a) / (b - a), 0.0, 1.0) * (d - c) + c
    return Volume(np.asarray(values, dtype=np.float32), affine)


def _turned(array: NumberArray, plan: BundlePlan) -> NumberArray:
    return np.flip(array, _FLIPS[plan.axes])


def _on(mask: Volume, grid: Volume) -> BoolArray:
    image = sitk.Cast(mask.with_array(mask.array.astype(np.uint8)).to_sitk(), sitk.sitkFloat32)
    found = sitk.Resample(
        image,
        grid.with_array(np.zeros(grid.array.shape, dtype=np.uint8)).to_sitk(),
        sitk.Transform(),
        sitk.sitkLinear,
        0.0,
    )
    return np.asarray(Volume.from_sitk(found).array > 0.5)
