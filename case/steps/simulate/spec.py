"""The specification of a simulation (SPEC.json), read and checked.

Every key may be left out but ``stiffness_kpa`` and ``walls``; the example shows the defaults where there are any:

    {"name": "made-up",                       the case's name; the folder's by default
     "source": "phantom",                     or {"case": FOLDER}, or {"ct": FOLDER, "labels": RTSTRUCT or label volume}
     "stiffness_kpa": {"prostate_left": 15, "prostate_right": 42},           true shear moduli G, every organ label present
     "tissue_kpa": 20, "tissue_poisson_ratio": 0.49, "mu1_share": 0.5,
     "walls": {"contact": "gliding",          or "tied": every point of a wall goes where the motion says
               "rectum": {"inflate_mm": 9, "bias": [0, 0], "push_mm": [0, 0, 0], "middle_mm": 0, "half_length_mm": 36},
               "bladder": {"balance": 0.9, "volume_change_cc": null, "push_mm": [0, 0, 0]}},
     "contour_noise_sd_mm": 0, "noise_correlation_mm": 8,
     "mesh": {"edge_mm": 3.7, "element": "p2"},
     "scan": {"shift_mm": [0, 0, 0], "rotation_deg": [0, 0, 0], "voxel_mm": [1.2, 1.2, 2], "noise_hu": 12, "blur_mm": 0.5},
     "output": "dicom",                       CT pair and contours; or "labels": label volumes only
     "seed": 1}

docs/simulate.md says it for users, `simulate_walls` what the walls' numbers mean; paths are relative to the SPEC.json.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate.case.steps.simulate.from_ct import CtSource
from palpate.case.steps.simulate.spec_reader import Reader
from palpate.core.errors import InputError
from palpate.imaging.labels import LABEL_VALUES, LABELS, ORGAN_LABELS
from palpate.simulate.solve import Stiffness
from palpate.simulate.walls import BladderSpec, RectumSpec

OUTPUTS = ("dicom", "labels")
# Not p1, which locks, and not the element that identifies.
ELEMENTS = ("p2", "p2p0")
CONTACTS = ("gliding", "tied")
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ScanSpec:
    """How the phantom is scanned (voxel, noise, blur) and how the patient lies in the second scan (shift, rotation)."""

    shift_mm: Triple = (0.0, 0.0, 0.0)
    rotation_deg: Triple = (0.0, 0.0, 0.0)
    voxel_mm: Triple = (1.2, 1.2, 2.0)
    noise_hu: float = 12.0
    blur_mm: float = 0.5


@dataclass(frozen=True)
class SimulationSpec:
    """See the module. source : "phantom", the path of a case, or a CT with contours. raw : as it was written."""

    source: str | Path | CtSource
    stiffness: Stiffness
    rectum: RectumSpec | None
    bladder: BladderSpec | None
    contact: str = "gliding"
    name: str | None = None
    contour_noise_sd_mm: float = 0.0
    noise_correlation_mm: float = 8.0
    edge_mm: float = 3.7
    element: str = "p2"
    scan: ScanSpec = ScanSpec()
    output: str = "dicom"
    seed: int = 1
    raw: Mapping[str, Any] = field(default_factory=dict)


def load_spec(path: Path | str) -> dict[str, Any]:
    """The JSON object of a SPEC.json. Raises InputError naming the file when it is missing or no JSON object."""
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read; give the path of a simulation's SPEC.json") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path} is not valid JSON at line {error.lineno}; correct it") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} holds no JSON object; docs/simulate.md tells its form")
    return data


def parse_spec(data: Mapping[str, Any], base: Path | None = None) -> SimulationSpec:
    """The checked specification. base : folder that relative paths start from.

    Raises InputError, one line: the property, its value and what is allowed.
    """
    top = Reader(data, "")
    top.only("name source stiffness_kpa tissue_kpa tissue_poisson_ratio mu1_share walls contour_noise_sd_mm "
             "noise_correlation_mm mesh scan output seed")  # fmt: skip
    walls, mesh = top.part("walls"), top.part("mesh")
    walls.only("contact rectum bladder")
    mesh.only("edge_mm element")
    if not {"rectum", "bladder"} & set(walls.data):
        raise top.refuse("walls", "an object with 'rectum', 'bladder' or both")
    return SimulationSpec(
        source=_source(top, base or Path()),
        stiffness=_stiffness(top),
        rectum=_rectum(walls.part("rectum")) if "rectum" in walls.data else None,
        bladder=_bladder(walls.part("bladder")) if "bladder" in walls.data else None,
        contact=walls.choice("contact", CONTACTS),
        name=top.text("name", None),
        contour_noise_sd_mm=top.number("contour_noise_sd_mm", 0.0, 0.0, 3.0),
        noise_correlation_mm=top.number("noise_correlation_mm", 8.0, 2.0, 50.0),
        edge_mm=mesh.number("edge_mm", 3.7, 2.0, 12.0),
        element=mesh.choice("element", ELEMENTS),
        scan=_scan(top.part("scan")),
        output=top.choice("output", OUTPUTS),
        seed=int(top.number("seed", 1, 0, 2**31 - 1, whole=True)),
        raw=dict(data),
    )


def _stiffness(top: Reader) -> Stiffness:
    organ = top.part("stiffness_kpa")
    names = [LABELS[label] for label in ORGAN_LABELS]
    organ.only(" ".join(names))
    if not organ.data:
        raise top.refuse("stiffness_kpa", f"an object with {' and '.join(names)}, each a number from 0.5 to 2000")
    return Stiffness(
        {LABEL_VALUES[name]: organ.number(name, None, 0.5, 2000.0) for name in names if name in organ.data},
        top.number("tissue_kpa", 20.0, 0.5, 2000.0),
        top.number("tissue_poisson_ratio", 0.49, 0.0, 0.498),
        top.number("mu1_share", 0.5, 0.0, 1.0),
    )


def _rectum(wall: Reader) -> RectumSpec:
    wall.only("inflate_mm bias push_mm middle_mm half_length_mm")
    return RectumSpec(
        wall.number("inflate_mm", 9.0, -10.0, 25.0),
        wall.numbers("bias", (0.0, 0.0), -0.7, 0.7),  # type: ignore[arg-type]
        wall.numbers("push_mm", (0.0, 0.0, 0.0), -15.0, 15.0),  # type: ignore[arg-type]
        wall.number("middle_mm", 0.0, -60.0, 60.0),
        wall.number("half_length_mm", 36.0, 10.0, 200.0),
    )


def _bladder(wall: Reader) -> BladderSpec:
    wall.only("volume_change_cc balance push_mm")
    change = wall.data.get("volume_change_cc")
    return BladderSpec(
        None if change is None else wall.number("volume_change_cc", None, -400.0, 400.0),
        wall.number("balance", 0.9, 0.0, 1.5),
        wall.numbers("push_mm", (0.0, 0.0, 0.0), -15.0, 15.0),  # type: ignore[arg-type]
    )


def _scan(scan: Reader) -> ScanSpec:
    scan.only("shift_mm rotation_deg voxel_mm noise_hu blur_mm")
    return ScanSpec(
        scan.numbers("shift_mm", (0.0, 0.0, 0.0), -50.0, 50.0),  # type: ignore[arg-type]
        scan.numbers("rotation_deg", (0.0, 0.0, 0.0), -10.0, 10.0),  # type: ignore[arg-type]
        scan.numbers("voxel_mm", (1.2, 1.2, 2.0), 0.5, 6.0),  # type: ignore[arg-type]
        scan.number("noise_hu", 12.0, 0.0, 100.0),
        scan.number("blur_mm", 0.5, 0.0, 3.0),
    )


def _source(top: Reader, base: Path) -> str | Path | CtSource:
    value = top.data.get("source", "phantom")
    if value == "phantom":
        return "phantom"
    if not isinstance(value, Mapping) or ("case" not in value and not {"ct", "labels"} <= set(value)):
        raise top.refuse("source", '"phantom", {"case": FOLDER} or {"ct": FOLDER, "labels": FILE}')
    part = top.part("source")
    if "case" in value:
        part.only("case")
        return base / str(part.text("case", ""))
    part.only("ct labels")
    return CtSource(base / str(part.text("ct", "")), base / str(part.text("labels", "")))
