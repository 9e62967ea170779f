"""A MONAI bundle through the door for learned models, with a stand-in for torch and monai."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.models.learned import learned_masks

METADATA = {
    "network_data_format": {"outputs": {"pred": {"channel_def": {"0": "background", "1": "Prostate", "2": "bladder"}}}}
}
INFERENCE: dict[str, Any] = {
    "imports": ["$import glob"],
    "spacing": [2.0, 2.0, 2.5],
    "preprocessing": {"_target_": "Compose", "transforms": [
        {"_target_": "LoadImaged", "keys": "image"},
        {"_target_": "Orientationd", "keys": "image", "axcodes": "RAS"},
        {"_target_": "monai.transforms.Spacingd", "keys": "image", "pixdim": "@spacing"},
        {"_target_": "ScaleIntensityRanged", "keys": "image", "a_min": -100, "a_max": 300, "b_min": 0, "b_max": 1, "clip": True},
    ]},
    "inferer": {"_target_": "SlidingWindowInferer", "roi_size": [32, 32, 32], "overlap": 0.5},
}  # fmt: skip


def _bundle(folder: Path, inference: dict[str, Any] = INFERENCE, metadata: dict[str, Any] = METADATA) -> Path:
    for name in ("configs", "models"):
        (folder / name).mkdir(parents=True)
    (folder / "configs/metadata.json").write_text(json.dumps(metadata))
    (folder / "configs/inference.json").write_text(json.dumps(inference))
    (folder / "models/model.ts").write_bytes(b"a script")
    return folder


def _scan() -> Volume:
    """Bright blob 1 to the left and front, blob 2 above and to the right, on a grid with turned axes."""
    affine = np.array([[0.0, -1.5, 0.0, 40.0], [1.5, 0.0, 0.0, -60.0], [0.0, 0.0, 3.0, 10.0], [0.0, 0.0, 0.0, 1.0]])
    grid = Volume(np.zeros((52, 60, 24), dtype=np.int16), affine)
    points = grid.to_lps(np.indices(grid.array.shape).reshape(3, -1).T.astype(float)).reshape(*grid.array.shape, 3)
    array = np.full(grid.array.shape, -100, dtype=np.int16)
    array[np.linalg.norm(points - [10.0, -40.0, 35.0], axis=-1) < 14.0] = 100
    array[np.linalg.norm(points - [-25.0, -10.0, 60.0], axis=-1) < 12.0] = 300
    return grid.with_array(array)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the stand-in network was given: it calls 0.5 prostate and 1 bladder."""
    given: list[Any] = []

    class _Network:
        def eval(self) -> _Network:
            return self

    class _Quiet:
        def __enter__(self) -> None: ...
        def __exit__(self, *why: object) -> None: ...

    def window(image: np.ndarray, patch: Any, batch: int, network: Any, overlap: float) -> np.ndarray:
        given.append((image, patch, overlap))
        x = image[0, 0]
        return np.stack([0.3 - x, (np.abs(x - 0.5) < 0.25) * 1.0, (x > 0.75) * 2.0])[None]

    torch, inferers = ModuleType("torch"), ModuleType("monai.inferers")
    torch.jit = ModuleType("jit")  # type: ignore[attr-defined]
    torch.jit.load = lambda path, map_location: _Network()  # type: ignore[attr-defined]
    torch.no_grad, torch.from_numpy = _Quiet, lambda array: array  # type: ignore[attr-defined]
    inferers.sliding_window_inference = window  # type: ignore[attr-defined]
    for name, module in (("torch", torch), ("monai", ModuleType("monai")), ("monai.inferers", inferers)):
        monkeypatch.setitem(sys.modules, name, module)
    return given


def test_a_bundle_sees_the_scan_as_it_wants_it(tmp_path: Path, asked: list[Any]) -> None:
    scan = _scan()
    masks = learned_masks(scan, f"monai:{_bundle(tmp_path / 'bundle')}")
    image, patch, overlap = asked[0]
    assert patch == (32, 32, 32) and overlap == 0.5
    assert image.shape[2:] == (45, 39, 29)
    assert image.min() == 0.0 and image.max() == 1.0
    # RAS: the bladder, on the right and behind, is at high i and low j.
    i, j, k = np.argwhere(image[0, 0] > 0.9).mean(axis=0)
    assert i > 22 and j < 20 and k > 14
    for organ, value in (("prostate", 100), ("bladder", 300)):
        true = scan.array == value
        assert 2.0 * (masks[organ].array & true).sum() / (masks[organ].array.sum() + true.sum()) > 0.9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"spacing": "$[1, 1, 1]"}, "expressions are not evaluated"),
        ({"preprocessing": {"transforms": [{"_target_": "NormalizeIntensityd"}]}}, "asks for 'NormalizeIntensity'"),
        ({"preprocessing": {"transforms": [{"_target_": "Orientationd", "axcodes": "PIR"}]}}, "axes 'PIR'"),
        ({"inferer": {"_target_": "SlidingWindowInferer", "roi_size": [0, 32, 32]}}, "cannot be"),
        ({"preprocessing": {"transforms": [{"_target_": "Spacingd", "pixdim": [0.01, 1, 1]}]}}, "too fine"),
    ],
)
def test_what_a_bundle_may_not_ask_for(change: dict[str, Any], message: str, tmp_path: Path, asked: list[Any]) -> None:
    folder = _bundle(tmp_path / "bundle", INFERENCE | change)
    with pytest.raises(InputError, match=message):
        learned_masks(_scan(), f"monai:{folder}")
    assert not asked


def test_a_pickle_is_never_loaded(tmp_path: Path, asked: list[Any]) -> None:
    folder = _bundle(tmp_path / "bundle")
    (folder / "models/model.ts").rename(folder / "models/model.pt")
    with pytest.raises(InputError, match="only TorchScript is run, never a pickle"):
        learned_masks(_scan(), f"monai:{folder}")


def test_what_is_not_a_bundle_or_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="monai:FOLDER"):
        learned_masks(_scan(), "monai")
    with pytest.raises(InputError, match=r"metadata\.json is not there"):
        learned_masks(_scan(), f"monai:{tmp_path}")
    liver = {"network_data_format": {"outputs": {"pred": {"channel_def": {"1": "liver"}}}}}
    with pytest.raises(InputError, match="names no channel"):
        learned_masks(_scan(), f"monai:{_bundle(tmp_path / 'liver', metadata=liver)}")
    monkeypatch.setitem(sys.modules, "monai.inferers", None)
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match="pip install monai"):
        learned_masks(_scan(), f"monai:{_bundle(tmp_path / 'bundle')}")
